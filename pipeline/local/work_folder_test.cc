// SPDX-License-Identifier: Apache-2.0
#include "pipeline/local/work_folder.h"

#include <cstdlib>
#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/base/check.h"
#include "common/base/files.h"

namespace meshwright {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

class WorkFolderTest : public testing::Test {
 protected:
  void SetUp() override {
    std::string pattern = testing::TempDir() + "work_folder_XXXXXX";
    MW_CHECK(mkdtemp(pattern.data()) != nullptr);
    parent_ = pattern;
    path_ = parent_ + "/mesh.ply.work";
  }
  void TearDown() override { fs::remove_all(parent_); }

  absl::StatusOr<std::unique_ptr<WorkFolder>> Open(char scene, const std::string& options, bool restart = false) {
    return WorkFolder::Open(path_, std::string(64, scene), options, restart, clock_);
  }

  ManualClock clock_;
  std::string parent_;
  std::string path_;
};

TEST_F(WorkFolderTest, GoesOnWithWhatItHolds) {
  std::string digest;
  {
    auto folder = Open('a', R"({"window":3})");
    ASSERT_TRUE(folder.ok()) << folder.status();
    EXPECT_FALSE((*folder)->resumed());
    digest = *(*folder)->blobs().Put("surface");
    ASSERT_TRUE((*folder)->store().AddBlobRef(WorkFolder::kReconstructionId, digest).ok());
  }
  auto folder = Open('a', R"({"window":3})");
  ASSERT_TRUE(folder.ok()) << folder.status();
  EXPECT_TRUE((*folder)->resumed());
  EXPECT_EQ(*(*folder)->blobs().Get(digest), "surface");
  EXPECT_EQ((*folder)->store().GetReconstruction(WorkFolder::kReconstructionId)->options_json, R"({"window":3})");
}

TEST_F(WorkFolderTest, NamesWhatDiffers) {
  ASSERT_TRUE(Open('a', R"({"window":3,"support":2})").ok());
  const absl::Status scene = Open('b', R"({"window":3,"support":2})").status();
  EXPECT_TRUE(absl::IsFailedPrecondition(scene));
  EXPECT_THAT(std::string(scene.message()), HasSubstr("the scene"));
  const absl::Status options = Open('a', R"({"window":1,"support":2})").status();
  EXPECT_TRUE(absl::IsFailedPrecondition(options));
  EXPECT_THAT(std::string(options.message()), HasSubstr("--window was 3, now 1"));
  EXPECT_THAT(std::string(options.message()), testing::Not(HasSubstr("support")));
  EXPECT_TRUE(Open('a', R"({"window":3,"support":2})").ok()) << "asking changes nothing";
}

TEST_F(WorkFolderTest, TheMethodsVersionCountsAndTheProgramsDoesNot) {
  ASSERT_TRUE(Open('a', R"({"version":"0.1.0","window":3})").ok());  // as programs before the method's version wrote
  EXPECT_TRUE(Open('a', R"({"method":1,"window":3})").ok());
  const absl::Status next = Open('a', R"({"method":2,"window":3})").status();
  EXPECT_TRUE(absl::IsFailedPrecondition(next));
  EXPECT_THAT(std::string(next.message()), HasSubstr("begun with version 1 of the method, this program has version 2"));
}

TEST_F(WorkFolderTest, RestartThrowsAwayWhatItHolds) {
  std::string digest;
  {
    auto folder = Open('a', "{}");
    digest = *(*folder)->blobs().Put("surface");
  }
  auto folder = Open('b', "{}", true);
  ASSERT_TRUE(folder.ok()) << folder.status();
  EXPECT_FALSE((*folder)->resumed());
  EXPECT_FALSE(*(*folder)->blobs().Has(digest));
}

TEST_F(WorkFolderTest, RemovedNothingIsLeft) {
  auto folder = Open('a', "{}");
  ASSERT_TRUE(folder.ok()) << folder.status();
  ASSERT_TRUE((*folder)->blobs().Put("surface").ok());
  ASSERT_TRUE(WriteFileAtomically((*folder)->MeshPath(), "ply").ok());
  ASSERT_TRUE((*folder)->Remove().ok());
  EXPECT_FALSE(fs::exists(path_));
}

TEST_F(WorkFolderTest, ASecondProcessIsKeptOut) {
  auto first = Open('a', "{}");
  ASSERT_TRUE(first.ok());
  EXPECT_TRUE(absl::IsUnavailable(Open('a', "{}").status()));
  EXPECT_TRUE(absl::IsUnavailable(Open('a', "{}", true).status()));
  first->reset();
  EXPECT_TRUE(Open('a', "{}").ok());
}

TEST_F(WorkFolderTest, RemoveLeavesWhatIsNotOurs) {
  {
    auto folder = Open('a', "{}");
    ASSERT_TRUE((*folder)->Remove().ok());
  }
  EXPECT_FALSE(fs::exists(path_));
  {
    auto folder = Open('a', "{}");
    ASSERT_TRUE(WriteFileAtomically(path_ + "/notes.txt", std::string("mine")).ok());
    ASSERT_TRUE((*folder)->Remove().ok());
  }
  EXPECT_EQ(*ReadFile(path_ + "/notes.txt"), "mine");
}

TEST_F(WorkFolderTest, DamagedStateIsNamed) {
  ASSERT_TRUE(Open('a', "{}").ok());
  ASSERT_TRUE(WriteFileAtomically(path_ + "/state.sqlite", std::string(9000, '?')).ok());
  const absl::Status status = Open('a', "{}").status();
  EXPECT_TRUE(absl::IsDataLoss(status)) << status;
  EXPECT_THAT(std::string(status.message()), HasSubstr("state.sqlite"));
  EXPECT_TRUE(Open('a', "{}", true).ok());
}

TEST_F(WorkFolderTest, AMissingParentIsNamed) {
  path_ = parent_ + "/nowhere/work";
  EXPECT_THAT(std::string(Open('a', "{}").status().message()), HasSubstr(path_));
}

}  // namespace
}  // namespace meshwright
