// SPDX-License-Identifier: Apache-2.0
#include "coordinator/store/sqlite_job_store.h"

#include <cstdlib>
#include <filesystem>
#include <fstream>

#include <gtest/gtest.h>
#include <sqlite3.h>

#include "common/base/check.h"
#include "coordinator/store/job_store_conformance.h"

namespace meshwright {

const std::vector<std::pair<std::string, std::string>>& SqliteMigrations();

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

TEST(SqliteJobStoreTest, AStoreOfTheFirstVersionIsBroughtUpToDateWithWhatIsInIt) {
  const auto folder = MakeTemporaryFolder();
  const std::string path = *folder + "/state.sqlite";
  sqlite3* old = nullptr;
  ASSERT_EQ(sqlite3_open(path.c_str(), &old), SQLITE_OK);
  const std::string digest = "'" + std::string(64, 'a') + "'";
  const std::string sql = SqliteMigrations().front().second + "INSERT INTO reconstructions VALUES ('castle', '{}', " +
                          digest + ", 'running', 5);" +
                          "INSERT INTO camera_jobs (reconstruction_id, sequence, camera, snapshot, assigned_at) VALUES "
                          "('castle', 1, 7, 0, 5);" +
                          "UPDATE camera_jobs SET state = 'done', filtered_digest = " + digest +
                          ", report_json = '{}', finished_at = 6;" + "INSERT INTO commits VALUES ('castle', 1, 7, " +
                          digest + ", 9, 4, 7);" + "PRAGMA application_id = 1297566291; PRAGMA user_version = 1;";
  ASSERT_EQ(sqlite3_exec(old, sql.c_str(), nullptr, nullptr, nullptr), SQLITE_OK) << sqlite3_errmsg(old);
  sqlite3_close(old);

  const auto store = OpenSqliteJobStore(path);
  ASSERT_TRUE(store.ok()) << store.status();
  EXPECT_EQ((*store)->GetReconstruction("castle")->state, ReconstructionState::kRunning);
  EXPECT_EQ((*store)->GetCameraJob("castle", 1)->state, CameraJobState::kDone);
  EXPECT_THAT(*(*store)->ListCommits("castle"), testing::ElementsAre(Commit{1, 7, std::string(64, 'a'), 9, 4}));
  // Foreign keys still point at the table that was made anew.
  EXPECT_FALSE((*store)->PutSceneFile("ruin", {"a", 1, std::string(64, 'a')}).ok());
  EXPECT_TRUE((*store)->DeleteReconstruction("castle").ok());
  EXPECT_TRUE((*store)->ListCommits("castle")->empty());
}

}  // namespace
}  // namespace meshwright
