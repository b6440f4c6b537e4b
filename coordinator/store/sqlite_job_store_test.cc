#include "coordinator/store/sqlite_job_store.h"

#include <cstdlib>
#include <filesystem>
#include <fstream>

#include <gtest/gtest.h>

#include "common/base/check.h"
#include "coordinator/store/job_store_conformance.h"

namespace meshwright {
namespace {

// A folder of its own, removed when the last copy goes.
std::shared_ptr<std::string> MakeTemporaryFolder() {
  std::string pattern = testing::TempDir() + "job_store_XXXXXX";
  MW_CHECK(mkdtemp(pattern.data()) != nullptr);
  return {new std::string(pattern), [](std::string* path) {
            std::filesystem::remove_all(*path);
            delete path;
          }};
}

JobStoreFixture MakeSqliteFixture() {
  const auto folder = MakeTemporaryFolder();
  const auto open = [folder]() -> std::unique_ptr<JobStore> {
    auto store = OpenSqliteJobStore(*folder + "/state.sqlite");
    return store.ok() ? *std::move(store) : nullptr;
  };
  return {open(), open};
}

INSTANTIATE_TEST_SUITE_P(Sqlite, JobStoreConformance, testing::Values(JobStoreFactory(MakeSqliteFixture)));

TEST(SqliteJobStoreTest, AFileThatIsNoDatabaseIsNamed) {
  const auto folder = MakeTemporaryFolder();
  const std::string path = *folder + "/state.sqlite";
  std::ofstream(path) << std::string(5000, 'x');
  const auto store = OpenSqliteJobStore(path);
  EXPECT_TRUE(absl::IsDataLoss(store.status())) << store.status();
  EXPECT_THAT(std::string(store.status().message()), testing::HasSubstr(path));
}

TEST(SqliteJobStoreTest, AFolderThatIsNotThereIsNamed) {
  const auto store = OpenSqliteJobStore("/nonexistent/state.sqlite");
  EXPECT_FALSE(store.ok());
  EXPECT_THAT(std::string(store.status().message()), testing::HasSubstr("/nonexistent/state.sqlite"));
}

}  // namespace
}  // namespace meshwright
