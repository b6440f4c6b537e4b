// SPDX-License-Identifier: Apache-2.0
#include "coordinator/store/postgres_job_store.h"

#include <atomic>

#include <absl/time/time.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/base/clock.h"
#include "coordinator/store/job_store_conformance.h"
#include "coordinator/store/postgres_connection.h"
#include "coordinator/store/postgres_testing.h"

namespace meshwright {
namespace {

using testing::HasSubstr;
using testing::Not;

std::unique_ptr<JobStore> OpenOrNull(const std::string& url) {
  auto store = OpenPostgresJobStore(url);
  EXPECT_TRUE(store.ok()) << store.status();
  return store.ok() ? *std::move(store) : nullptr;
}

JobStoreFixture MakePostgresFixture() {
  const auto server = SharedTestPostgres();
  if (!server.ok()) return {.skip = server.status().ToString()};
  const auto schema = std::make_shared<PostgresSchema>(*server);
  const auto open = [schema] { return OpenOrNull(schema->url()); };
  return {.store = open(), .reopen = open};
}

INSTANTIATE_TEST_SUITE_P(Postgres, JobStoreConformance, testing::Values(JobStoreFactory(MakePostgresFixture)));

class PostgresJobStoreTest : public testing::Test {
 protected:
  void SetUp() override {
    const auto server = SharedTestPostgres();
    if (!server.ok()) GTEST_SKIP() << server.status();
    server_url_ = *server;
    schema_ = std::make_unique<PostgresSchema>(server_url_);
  }

  static inline const absl::Time kNow = absl::FromUnixSeconds(1'000'000'000);
  static inline const Reconstruction kReconstruction = {
      .id = "castle", .options_json = "{}", .scene_digest = std::string(64, '0')};

  std::string server_url_;
  std::unique_ptr<PostgresSchema> schema_;
};

TEST(NumberParametersTest, NamesBecomeNumbersInOrder) {
  const PostgresStatement statement = NumberParameters("a = :x AND b = :long_name OR c = :x; :");
  EXPECT_EQ(statement.sql, "a = $1 AND b = $2 OR c = $1; :");
  EXPECT_THAT(statement.parameters, testing::ElementsAre("x", "long_name"));
}

TEST(DescribePostgresUrlTest, NamesTheServerAndNeverThePassword) {
  EXPECT_EQ(*DescribePostgresUrl("postgresql://me:secret@db.example:6543/jobs"), "PostgreSQL at db.example:6543/jobs");
  EXPECT_EQ(*DescribePostgresUrl("host=db dbname=jobs password=secret"), "PostgreSQL at db:5432/jobs");
  const absl::Status status = DescribePostgresUrl("postgresql://me:secret@db:65x43:1/jobs]?a").status();
  EXPECT_TRUE(absl::IsInvalidArgument(status)) << status;
  EXPECT_THAT(status.ToString(), Not(HasSubstr("secret")));
}

TEST_F(PostgresJobStoreTest, ManyCoordinatorsMayStartAtOnce) {
  constexpr int kCoordinators = 6;
  std::atomic<int> opened{0};
  std::vector<std::thread> threads;
  threads.reserve(kCoordinators);
  for (int t = 0; t < kCoordinators; ++t) {
    threads.emplace_back([&] { opened += OpenOrNull(schema_->url()) != nullptr ? 1 : 0; });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(opened.load(), kCoordinators);
  EXPECT_EQ(RunSql(schema_->url(), "SELECT count(*) FROM meshwright_migrations"), "8");
}

TEST_F(PostgresJobStoreTest, ADatabaseOfANewerProgramIsRefused) {
  ASSERT_NE(OpenOrNull(schema_->url()), nullptr);
  RunSql(schema_->url(), "INSERT INTO meshwright_migrations (number, file) VALUES (999, 'later.sql')");
  const auto store = OpenPostgresJobStore(schema_->url());
  EXPECT_TRUE(absl::IsFailedPrecondition(store.status())) << store.status();
  EXPECT_THAT(store.status().ToString(), HasSubstr("newer version"));
}

TEST_F(PostgresJobStoreTest, ADatabaseThatIsNotThereIsRefusedAtOnce) {
  const Stopwatch waited;
  const auto store = OpenPostgresJobStore(server_url_ + "_missing");
  EXPECT_TRUE(absl::IsPermissionDenied(store.status())) << store.status();
  EXPECT_LT(waited.Elapsed(), absl::Seconds(10));
}

TEST_F(PostgresJobStoreTest, AServerThatIsNotThereIsUnavailableWhenTheRetryDeadlineEnds) {
  const auto store =
      OpenPostgresJobStore("postgresql://me:secret@127.0.0.1:1/jobs", {.retry_deadline = absl::Milliseconds(300)});
  EXPECT_TRUE(absl::IsUnavailable(store.status())) << store.status();
  EXPECT_THAT(store.status().ToString(), HasSubstr("127.0.0.1:1/jobs"));
  EXPECT_THAT(store.status().ToString(), Not(HasSubstr("secret")));
}

TEST_F(PostgresJobStoreTest, TheClockIsTheDatabases) {
  const auto store = OpenOrNull(schema_->url());
  const std::string sql = "SELECT CAST(extract(epoch FROM clock_timestamp()) * 1000000 AS BIGINT)";
  const int64_t before = std::stoll(RunSql(schema_->url(), sql));
  const auto now = store->Now();
  ASSERT_TRUE(now.ok()) << now.status();
  EXPECT_GE(absl::ToUnixMicros(*now), before - 1);
  EXPECT_LE(absl::ToUnixMicros(*now), std::stoll(RunSql(schema_->url(), sql)) + 1);
}

TEST_F(PostgresJobStoreTest, SessionsThatTheServerEndsAreMadeAnew) {
  const auto store = OpenOrNull(schema_->url());
  ASSERT_TRUE(store->CreateReconstruction(kReconstruction, kNow).ok());
  const int64_t epoch = *store->AcquireConductorLease("castle", "north", kNow + absl::Seconds(1), kNow);
  for (int s = 1; s <= 20; ++s) {
    RunSql(server_url_,
           "SELECT count(pg_terminate_backend(pid)) FROM pg_stat_activity WHERE application_name = 'meshwright'");
    const absl::Status status = store->Advance("castle", {}, {{s, s, 0}}, {}, kNow, epoch);
    EXPECT_TRUE(status.ok()) << status;
  }
  EXPECT_EQ(store->ListCameraJobs("castle")->size(), 20);
}

// The reader of a lease must not run away with a commit that is still on its way: a conductor's write and the takeover
// by the next exclude each other.
TEST_F(PostgresJobStoreTest, ATakeoverWaitsForTheWriteThatWasFirst) {
  const auto store = OpenOrNull(schema_->url());
  ASSERT_TRUE(store->CreateReconstruction(kReconstruction, kNow).ok());
  ASSERT_EQ(*store->AcquireConductorLease("castle", "north", kNow + absl::Seconds(1), kNow), 1);
  std::atomic<bool> taken{false};
  std::thread south;
  {
    // What Advance() holds while its transaction is open.
    std::thread north([&] {
      RunSql(schema_->url(),
             "BEGIN; SELECT 1 FROM conductor_leases WHERE epoch = 1 FOR SHARE; SELECT pg_sleep(0.5); COMMIT");
    });
    absl::SleepFor(absl::Milliseconds(200));
    south = std::thread([&] {
      const auto epoch =
          store->AcquireConductorLease("castle", "south", kNow + absl::Hours(1), kNow + absl::Seconds(2));
      EXPECT_TRUE(epoch.ok()) << epoch.status();
      taken = true;
    });
    absl::SleepFor(absl::Milliseconds(100));
    EXPECT_FALSE(taken.load());
    north.join();
  }
  south.join();
  EXPECT_TRUE(taken.load());
}

// Threads write without a pause while the server is restarted, once in good order and once as after a crash: each call
// comes through, and nothing is lost.
TEST(PostgresRestartTest, CallsOutliveARestart) {
  const auto server = PostgresServer::Start();
  if (absl::IsNotFound(server.status())) GTEST_SKIP() << server.status();
  ASSERT_TRUE(server.ok()) << server.status();
  const auto store = OpenOrNull((*server)->url());
  ASSERT_NE(store, nullptr);
  const absl::Time now = absl::FromUnixSeconds(1'000'000'000);
  ASSERT_TRUE(store->CreateReconstruction({"castle", "{}", std::string(64, '0')}, now).ok());
  const int64_t epoch = *store->AcquireConductorLease("castle", "north", now + absl::Seconds(1), now);
  constexpr int kThreads = 3;
  std::atomic<bool> stop{false};
  std::atomic<int> next{1};
  std::vector<std::thread> threads;
  threads.reserve(kThreads);
  for (int t = 0; t < kThreads; ++t) {
    threads.emplace_back([&] {
      while (!stop) {
        const int s = next++;
        const absl::Status assigned = store->Advance("castle", {}, {{s, s, 0}}, {}, now, epoch);
        EXPECT_TRUE(assigned.ok()) << assigned;
        const auto completed = store->ApplyChanges({{.kind = JobChange::Kind::kComplete,
                                                     .id = "castle",
                                                     .sequence = s,
                                                     .epoch = 1,
                                                     .filtered_digest = std::string(64, 'a'),
                                                     .report_json = "{}"}},
                                                   {}, now);
        EXPECT_TRUE(completed.ok()) << completed.status();
      }
    });
  }
  for (const char* mode : {"fast", "immediate"}) {
    absl::SleepFor(absl::Milliseconds(300));
    (*server)->Stop(mode);
    absl::SleepFor(absl::Milliseconds(300));
    (*server)->StartAgain();
  }
  absl::SleepFor(absl::Milliseconds(1500));
  stop = true;
  for (std::thread& thread : threads) thread.join();
  const auto jobs = store->ListCameraJobs("castle");
  ASSERT_TRUE(jobs.ok()) << jobs.status();
  EXPECT_EQ(jobs->size(), static_cast<size_t>(next - 1));
  for (const CameraJob& job : *jobs) EXPECT_EQ(job.state, CameraJobState::kDone) << job.sequence;
}

}  // namespace
}  // namespace meshwright
