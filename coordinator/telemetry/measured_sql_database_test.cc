// SPDX-License-Identifier: Apache-2.0
#include "coordinator/telemetry/measured_sql_database.h"

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "coordinator/store/postgres_job_store.h"
#include "coordinator/store/postgres_testing.h"
#include "coordinator/store/sqlite_job_store.h"
#include "coordinator/telemetry/cluster_gauges.h"

namespace meshwright {
namespace {

using testing::HasSubstr;
using testing::Not;

// A real store, so that what is counted is what its statements are called and mean.
class MeasuredStoreTest : public testing::Test {
 protected:
  void SetUp() override {
    const auto* const test = testing::UnitTest::GetInstance()->current_test_info();
    folder_ = testing::TempDir() + "measured_store_" + test->name();
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directories(folder_);
    auto store = OpenSqliteJobStore(folder_ + "/state.sqlite", &clock_, [this](std::unique_ptr<SqlDatabase> database) {
      auto measured = std::make_unique<MeasuredSqlDatabase>(
          std::move(database), metrics_,
          Logger(Logger::Format::kText, clock_, [this](const std::string& line) { lines_.push_back(line); }));
      database_ = measured.get();
      return measured;
    });
    ASSERT_TRUE(store.ok()) << store.status();
    store_ = *std::move(store);
    workers_ = std::make_unique<WorkerService>(LeaseOptions(), RetryOptions(), *store_);
    AddClusterGauges(metrics_, *database_, *workers_, folder_);
    ASSERT_TRUE(store_
                    ->CreateReconstruction({.id = "r", .options_json = "{}", .scene_digest = std::string(64, 'a')},
                                           clock_.Now())
                    .ok());
    const auto epoch = store_->AcquireConductorLease("r", "c", clock_.Now() + absl::Seconds(5), clock_.Now());
    ASSERT_TRUE(epoch.ok()) << epoch.status();
    epoch_ = *epoch;
  }
  void TearDown() override {
    workers_.reset();
    store_.reset();
    std::filesystem::remove_all(folder_);
  }
  void Assign(SequenceNumber sequence) {
    ASSERT_TRUE(store_->Advance("r", {}, {{sequence, sequence, sequence - 1}}, {}, clock_.Now(), epoch_).ok());
  }
  absl::Status AddCommit(const Commit& commit) { return store_->Advance("r", {commit}, {}, {}, clock_.Now(), epoch_); }
  void End(JobChange::Kind kind, SequenceNumber sequence, int64_t epoch) {
    const JobChange change = {.kind = kind,
                              .id = "r",
                              .sequence = sequence,
                              .epoch = epoch,
                              .filtered_digest = std::string(64, 'b'),
                              .report_json = "{}",
                              .reason = "failed too often"};
    const auto results = store_->ApplyChanges({change}, {}, clock_.Now());
    ASSERT_TRUE(results.ok() && results->front().status.ok());
  }
  // What a turn of a coordinator changes about job 1; returns its epoch.
  int64_t Change(JobChange::Kind kind, int64_t epoch) {
    const auto results = store_->ApplyChanges({{.kind = kind,
                                                .id = "r",
                                                .sequence = 1,
                                                .epoch = epoch,
                                                .worker = "w",
                                                .expires_at = clock_.Now() + absl::Seconds(10),
                                                .reason = "x"}},
                                              {}, clock_.Now());
    EXPECT_TRUE(results.ok()) << results.status();
    return store_->GetCameraJob("r", 1)->epoch;
  }
  void ExpectLine(const std::string& line) { EXPECT_THAT(metrics_.Text(), HasSubstr("\n" + line + "\n")); }

  std::string folder_;
  ManualClock clock_;
  Metrics metrics_{"coordinator"};
  std::vector<std::string> lines_;
  SqlDatabase* database_ = nullptr;
  std::unique_ptr<JobStore> store_;
  int64_t epoch_ = 0;  // of the conductor's lease
  std::unique_ptr<WorkerService> workers_;
};

TEST_F(MeasuredStoreTest, LeasesAreCountedByHowTheyEnd) {
  Assign(1);
  int64_t epoch = Change(JobChange::Kind::kClaim, 1);
  Change(JobChange::Kind::kRenew, epoch);
  Change(JobChange::Kind::kRelease, epoch);
  epoch = Change(JobChange::Kind::kClaim, epoch);
  Change(JobChange::Kind::kFail, epoch);
  Change(JobChange::Kind::kFail, epoch);  // a repetition
  epoch = Change(JobChange::Kind::kClaim, epoch);
  Change(JobChange::Kind::kLose, epoch);
  epoch = Change(JobChange::Kind::kClaim, epoch);
  End(JobChange::Kind::kComplete, 1, epoch);
  ExpectLine("meshwright_leases_granted_total 4");
  ExpectLine("meshwright_leases_renewed_total 1");
  for (const char* const outcome : {"finished", "failed", "released", "lost"}) {
    ExpectLine(std::string("meshwright_leases_ended_total{outcome=\"") + outcome + "\"} 1");
  }
  EXPECT_THAT(metrics_.Text(), Not(HasSubstr("meshwright_store_errors_total{")));
}

TEST_F(MeasuredStoreTest, CommitsBringAcceptedRaysAlsoInTransactions) {
  for (const SequenceNumber sequence : {1, 2}) {
    Assign(sequence);
    End(JobChange::Kind::kComplete, sequence, 1);
  }
  Assign(3);
  End(JobChange::Kind::kSkipped, 3, 1);
  const std::string accepted(64, 'c');
  const auto commit = [&](SequenceNumber sequence, int64_t patches) {
    return Commit{.sequence = sequence,
                  .camera = sequence,
                  .accepted_digest = patches > 0 ? accepted : "",
                  .filtered_patches = patches,
                  .accepted_patches = patches};
  };
  ASSERT_TRUE(AddCommit(commit(1, 100)).ok());
  ASSERT_TRUE(AddCommit(commit(1, 100)).ok());  // a repetition
  ASSERT_TRUE(store_
                  ->Advance("r", {commit(2, 20), commit(3, 0)}, {{.sequence = 4, .camera = 4, .snapshot = 3}}, {},
                            clock_.Now(), epoch_)
                  .ok());
  ExpectLine("meshwright_commits_total 3");
  ExpectLine("meshwright_rays_accepted_total 120");
  ExpectLine("meshwright_cameras_skipped_total 1");
  ExpectLine("meshwright_jobs_waiting 1");
}

TEST_F(MeasuredStoreTest, WhatHappensIsLoggedOnceAndWithNames) {
  Assign(1);
  const int64_t epoch = Change(JobChange::Kind::kClaim, 1);
  for (int repetition = 0; repetition < 2; ++repetition) Change(JobChange::Kind::kFail, epoch);
  EXPECT_THAT(lines_, testing::ElementsAre(
                          testing::EndsWith("info    reconstruction created  reconstruction=r  state=running"),
                          testing::EndsWith("info    conducting  reconstruction=r  coordinator=c"),
                          testing::EndsWith("info    job leased  reconstruction=r  sequence=1  attempt=1  worker=w"),
                          testing::EndsWith("warning job failed  reconstruction=r  sequence=1  attempt=2  worker=w  "
                                            "error=x")));
}

TEST_F(MeasuredStoreTest, GaugesFollowTheStore) {
  ExpectLine("meshwright_jobs_waiting 0");
  ExpectLine("meshwright_reconstructions{state=\"running\"} 1");
  Assign(1);
  Assign(2);
  clock_.Advance(absl::Seconds(90));
  ExpectLine("meshwright_jobs_waiting 2");
  ExpectLine("meshwright_longest_without_commit_seconds 90");
  End(JobChange::Kind::kComplete, 1, 1);
  ExpectLine("meshwright_jobs_waiting 1");
  ASSERT_TRUE(AddCommit({.sequence = 1, .camera = 1}).ok());
  ExpectLine("meshwright_longest_without_commit_seconds 0");
  // Jobs of what does not run are no queue.
  ASSERT_TRUE(store_->RequestState("r", ReconstructionState::kCancelled, clock_.Now()).ok());
  ExpectLine("meshwright_jobs_waiting 0");
  ExpectLine("meshwright_reconstructions{state=\"cancelled\"} 1");
  ExpectLine("meshwright_reconstructions{state=\"running\"} 0");
}

TEST_F(MeasuredStoreTest, WorkersAndTheDiskAreSeen) {
  v1::SynchronizeRequest request;
  request.set_worker_id("w");
  request.set_instance("i");
  request.set_cores(3);
  request.set_memory_bytes(1 << 30);
  ASSERT_TRUE(workers_->Synchronize(request, [] { return false; }).ok());
  ExpectLine("meshwright_workers 1");
  ExpectLine("meshwright_workers_cores 3");
  ExpectLine("meshwright_workers_draining 0");
  EXPECT_THAT(metrics_.Text(), testing::ContainsRegex("\nmeshwright_data_disk_free_bytes [1-9]"));
}

// The statements of the gauges are said in PostgreSQL's way too.
TEST(MeasuredPostgresTest, CountsAndGaugesAreThose) {
  const auto server = SharedTestPostgres();
  if (!server.ok()) GTEST_SKIP() << server.status();
  const PostgresSchema schema(*server);
  const RealClock clock;
  Metrics metrics("coordinator");
  SqlDatabase* database = nullptr;
  const auto store = OpenPostgresJobStore(schema.url(), {}, [&](std::unique_ptr<SqlDatabase> unmeasured) {
    auto measured = std::make_unique<MeasuredSqlDatabase>(std::move(unmeasured), metrics, Logger::Nowhere());
    database = measured.get();
    return measured;
  });
  ASSERT_TRUE(store.ok()) << store.status();
  const WorkerService workers(LeaseOptions(), RetryOptions(), **store);
  AddClusterGauges(metrics, *database, workers, "/");
  const absl::Time now = clock.Now();
  ASSERT_TRUE((*store)
                  ->CreateReconstruction({.id = "r", .options_json = "{}", .scene_digest = std::string(64, 'a')},
                                         now - absl::Hours(2))
                  .ok());
  EXPECT_THAT(metrics.Text(), testing::ContainsRegex("\nmeshwright_longest_without_commit_seconds 72[0-9][0-9]"));
  const int64_t epoch = *(*store)->AcquireConductorLease("r", "c", now + absl::Seconds(5), now);
  ASSERT_TRUE((*store)->Advance("r", {}, {{1, 1, 0}, {2, 2, 0}}, {}, now, epoch).ok());
  const JobChange done = {.kind = JobChange::Kind::kComplete,
                          .id = "r",
                          .sequence = 1,
                          .epoch = 1,
                          .filtered_digest = std::string(64, 'b'),
                          .report_json = "{}"};
  ASSERT_TRUE((*store)->ApplyChanges({done}, {}, now)->front().status.ok());
  ASSERT_TRUE((*store)->Advance("r", {{.sequence = 1, .camera = 1}}, {}, {}, now, epoch).ok());
  const std::string text = metrics.Text();
  for (const char* const line :
       {"meshwright_jobs_waiting 1", "meshwright_commits_total 1", "meshwright_reconstructions{state=\"running\"} 1",
        "meshwright_leases_ended_total{outcome=\"finished\"} 1"}) {
    EXPECT_THAT(text, HasSubstr(std::string("\n") + line + "\n"));
  }
  EXPECT_THAT(text, testing::ContainsRegex("\nmeshwright_longest_without_commit_seconds [0-9]\\."));
  EXPECT_THAT(text, Not(HasSubstr("meshwright_store_errors_total{")));
}

// Answers everything with an error.
class BrokenDatabase final : public SqlDatabase {
 public:
  absl::StatusOr<SqlResult> Run(const std::string&, const SqlParameters&) override {
    return absl::UnavailableError("gone");
  }
  absl::StatusOr<bool> RunTogether(const std::vector<SqlCall>&) override { return absl::UnavailableError("gone"); }
  absl::StatusOr<std::vector<SqlResult>> RunAll(const std::vector<SqlCall>&) override {
    return absl::UnavailableError("gone");
  }
  absl::StatusOr<absl::Time> Now() override { return absl::UnavailableError("gone"); }
};

TEST(MeasuredSqlDatabaseTest, ErrorsAreCountedAndChangeNothingElse) {
  Metrics metrics("coordinator");
  std::vector<std::string> lines;
  const ManualClock clock;
  const Logger log(Logger::Format::kText, clock, [&](const std::string& line) { lines.push_back(line); });
  MeasuredSqlDatabase database(std::make_unique<BrokenDatabase>(), metrics, log);
  EXPECT_FALSE(database.Run("add_commit", {{"accepted_patches", int64_t{5}}}).ok());
  EXPECT_FALSE(database.RunTogether({{"add_commit", {{"accepted_patches", int64_t{5}}}}}).ok());
  const std::string text = metrics.Text();
  EXPECT_THAT(text, HasSubstr("meshwright_store_errors_total{code=\"unavailable\",operation=\"add_commit\"} 1\n"));
  EXPECT_THAT(text, HasSubstr("meshwright_store_errors_total{code=\"unavailable\",operation=\"transaction\"} 1\n"));
  EXPECT_THAT(text, HasSubstr("meshwright_commits_total 0\n"));
  EXPECT_THAT(text, HasSubstr("meshwright_rays_accepted_total 0\n"));
  EXPECT_THAT(lines, testing::ElementsAre(HasSubstr("error   store failed  operation=add_commit  error=gone"),
                                          HasSubstr("error   store failed  operation=transaction  error=gone")));
}

}  // namespace
}  // namespace meshwright
