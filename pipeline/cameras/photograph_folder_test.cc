// SPDX-License-Identifier: Apache-2.0
#include "pipeline/cameras/photograph_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "pipeline/cameras/photographs_testing.h"

#include "common/base/bad_input.h"

namespace meshwright {
namespace {

std::vector<std::string> Names(const PhotographFolder& folder) {
  std::vector<std::string> names;
  for (const Photograph& photograph : folder.photographs) names.push_back(photograph.name);
  return names;
}

absl::StatusOr<PhotographFolder> ListAndCheck(const std::string& path) {
  absl::StatusOr<PhotographFolder> folder = ListPhotographs(path);
  if (!folder.ok()) return folder;
  ThreadPool pool(2);
  if (const absl::Status checked = CheckPhotographs(&*folder, pool, [](int) {}); !checked.ok()) return checked;
  return folder;
}

TEST(PhotographFolder, NamesAreInNaturalOrder) {
  const TemporaryFolder folder;
  for (const char* name : {"f10.jpg", "f9.jpg", "sub/f1.JPG", ".hidden.jpg", "notes.txt", "f010.jpg"}) {
    folder.Write(name, TestJpeg());
  }
  const auto listed = ListPhotographs(folder.path());
  ASSERT_TRUE(listed.ok()) << listed.status();
  EXPECT_THAT(Names(*listed), testing::ElementsAre("f9.jpg", "f010.jpg", "f10.jpg", "sub/f1.JPG"));
}

TEST(PhotographFolder, TooFewIsBadInputThatNamesTheWayOut) {
  const TemporaryFolder folder;
  folder.Write("a.jpg", TestJpeg());
  folder.Write("b.heic", "x");
  folder.Write("c.MOV", "x");
  const auto listed = ListPhotographs(folder.path());
  EXPECT_TRUE(IsBadInput(listed.status()));
  EXPECT_THAT(std::string(listed.status().message()),
              testing::AllOf(testing::HasSubstr("1 photographs"), testing::HasSubstr("heif-convert"),
                             testing::HasSubstr("ffmpeg")));
  EXPECT_TRUE(IsBadInput(ListPhotographs(folder / "nowhere").status()));
}

TEST(PhotographFolder, BrokenPhotographsAreLeftOutWithANote) {
  const TemporaryFolder folder;
  for (const char* name : {"a.jpg", "b.jpg", "c.jpg"}) folder.Write(name, TestJpeg());
  folder.Write("d.jpg", "no picture");
  folder.Write("e.jpg", TestJpeg().substr(0, 300));
  const auto checked = ListAndCheck(folder.path());
  ASSERT_TRUE(checked.ok()) << checked.status();
  EXPECT_THAT(Names(*checked), testing::ElementsAre("a.jpg", "b.jpg", "c.jpg"));
  EXPECT_THAT(checked->notes, testing::ElementsAre(testing::HasSubstr("d.jpg"), testing::HasSubstr("e.jpg")));
  EXPECT_EQ(checked->photographs[0].size.width, 64);
}

TEST(PhotographFolder, MasksAreFoundAndStrangeOnesNamed) {
  const TemporaryFolder folder;
  for (const char* name : {"a.jpg", "b.jpg", "c.jpg", "d.jpg"}) folder.Write(name, TestJpeg());
  folder.Write("masks/a.jpg.png", EncodePng(TestPicture(64, 48)));
  folder.Write("masks/b.png", EncodePng(TestPicture(64, 48)));
  folder.Write("masks/c.jpg.png", EncodePng(TestPicture(32, 48)));
  folder.Write("masks/x.jpg.png", EncodePng(TestPicture(64, 48)));
  const auto checked = ListAndCheck(folder.path());
  ASSERT_TRUE(checked.ok()) << checked.status();
  ASSERT_EQ(checked->photographs.size(), 4U);  // masks are no photographs
  EXPECT_THAT(checked->photographs[0].mask_path, testing::EndsWith("masks/a.jpg.png"));
  EXPECT_THAT(checked->photographs[1].mask_path, testing::EndsWith("masks/b.png"));
  EXPECT_EQ(checked->photographs[2].mask_path, "");
  EXPECT_THAT(checked->notes, testing::ElementsAre(testing::HasSubstr("x.jpg.png"), testing::HasSubstr("32 x 48")));
}

TEST(PhotographFolder, DigestFollowsNamesBytesAndMasksAndNothingElse) {
  const TemporaryFolder one;
  const TemporaryFolder two;
  for (const char* name : {"a.jpg", "b.jpg", "c.jpg"}) {
    one.Write(name, TestJpeg());
    two.Write(name, TestJpeg());
  }
  EXPECT_EQ(ListAndCheck(one.path())->digest, ListAndCheck(two.path())->digest);
  two.Write("masks/a.jpg.png", EncodePng(TestPicture(64, 48)));
  EXPECT_NE(ListAndCheck(one.path())->digest, ListAndCheck(two.path())->digest);
  one.Write("c.jpg", TestJpeg(64, 49));
  EXPECT_NE(ListAndCheck(one.path())->digest, ListAndCheck(two.path())->digest);
}

TEST(PhotographFolder, HoldsPhotographsLooksForThem) {
  const TemporaryFolder folder;
  EXPECT_FALSE(HoldsPhotographs(folder.path()));
  EXPECT_FALSE(HoldsPhotographs(folder / "nowhere"));
  folder.Write("sub/a.jpg", TestJpeg());
  EXPECT_TRUE(HoldsPhotographs(folder.path()));
}

}  // namespace
}  // namespace meshwright
