// SPDX-License-Identifier: Apache-2.0
// How many camera jobs a second the stores hand out, with as many callers as threads.
#include <cstdlib>
#include <filesystem>
#include <mutex>
#include <optional>

#include <absl/strings/str_cat.h>
#include <benchmark/benchmark.h>

#include "common/base/check.h"
#include "coordinator/store/postgres_job_store.h"
#include "coordinator/store/postgres_testing.h"
#include "coordinator/store/sqlite_job_store.h"

namespace meshwright {
namespace {

constexpr int kJobs = 200;  // waiting at a time: a window of this many
const absl::Time kNow = absl::FromUnixSeconds(1'000'000'000);

class TestStore {
 public:
  explicit TestStore(bool postgres) {
    if (postgres) {
      static const auto server = PostgresServer::Start(/*durable=*/true);
      MW_CHECK(server.ok());
      schema_.emplace((*server)->url());
      store_ = *OpenPostgresJobStore(schema_->url());
    } else {
      folder_ = (std::filesystem::temp_directory_path() / "store_benchmark_XXXXXX").string();
      MW_CHECK(mkdtemp(folder_.data()) != nullptr);
      store_ = *OpenSqliteJobStore(folder_ + "/state.sqlite");
    }
    MW_CHECK(store_->CreateReconstruction({"castle", "{}", std::string(64, '0')}, kNow).ok());
    const int64_t epoch = *store_->AcquireConductorLease("castle", "c", kNow + absl::Seconds(5), kNow);
    std::vector<CameraAssignment> cameras;
    for (int s = 1; s <= kJobs; ++s) cameras.push_back({s, s, 0});
    MW_CHECK(store_->Advance("castle", {}, cameras, {}, kNow, epoch).ok());
  }
  ~TestStore() {
    store_.reset();
    if (!folder_.empty()) std::filesystem::remove_all(folder_);
  }
  JobStore& operator*() { return *store_; }

 private:
  std::optional<PostgresSchema> schema_;
  std::string folder_;
  std::unique_ptr<JobStore> store_;
};

std::unique_ptr<TestStore> shared_store;  // of all threads of a run

// Claim some jobs, give them back: two durable transactions.
void ClaimAndRelease(benchmark::State& state) {
  if (state.thread_index() == 0) shared_store = std::make_unique<TestStore>(state.range(0) == 1);
  const std::string worker = absl::StrCat("worker", state.thread_index());
  const auto jobs = static_cast<int>(state.range(1));
  const int first = 1 + state.thread_index() * jobs;
  int64_t epoch = 1;
  for (auto _ : state) {
    std::vector<JobChange> changes;
    for (int s = first; s < first + jobs; ++s) {
      changes.push_back({.kind = JobChange::Kind::kClaim,
                         .id = "castle",
                         .sequence = s,
                         .epoch = epoch,
                         .worker = worker,
                         .expires_at = kNow + absl::Seconds(30)});
    }
    ++epoch;
    MW_CHECK((**shared_store).ApplyChanges(changes, {}, kNow)->back().status.ok());
    for (JobChange& change : changes) {
      change.kind = JobChange::Kind::kRelease;
      change.epoch = epoch;
    }
    MW_CHECK((**shared_store).ApplyChanges(changes, {}, kNow)->back().status.ok());
  }
  state.SetItemsProcessed(state.iterations() * jobs);
  if (state.thread_index() == 0) shared_store.reset();
}
BENCHMARK(ClaimAndRelease)
    ->ArgNames({"postgres", "jobs"})
    ->ArgsProduct({{0, 1}, {1, 20}})
    ->ThreadRange(1, 8)
    ->UseRealTime();

// What every turn of a coordinator reads, with 200 jobs open.
void ListOpenJobs(benchmark::State& state) {
  TestStore store(state.range(0) == 1);
  for (auto _ : state) MW_CHECK((*store).ListOpenJobs()->size() == kJobs);
}
BENCHMARK(ListOpenJobs)->ArgName("postgres")->Arg(0)->Arg(1)->UseRealTime();

// What one camera job costs the store from end to end: assigned, claimed, completed, committed.
void WholeLife(benchmark::State& state) {
  TestStore store(state.range(0) == 1);
  MW_CHECK((*store).CreateReconstruction({"abbey", "{}", std::string(64, '0')}, kNow).ok());
  const int64_t epoch = *(*store).AcquireConductorLease("abbey", "c", kNow + absl::Seconds(5), kNow);
  std::vector<Commit> commits;
  SequenceNumber s = 0;
  for (auto _ : state) {
    ++s;
    MW_CHECK((*store).Advance("abbey", commits, {{s, s, s - 1}}, {}, kNow, epoch).ok());
    JobChange change = {.kind = JobChange::Kind::kClaim,
                        .id = "abbey",
                        .sequence = s,
                        .epoch = 1,
                        .worker = "w",
                        .expires_at = kNow + absl::Seconds(30),
                        .filtered_digest = std::string(64, 'a'),
                        .report_json = R"({"seeds":9})"};
    MW_CHECK((*store).ApplyChanges({change}, {}, kNow)->front().status.ok());
    change.kind = JobChange::Kind::kComplete;
    change.epoch = 2;
    MW_CHECK((*store).ApplyChanges({change}, {}, kNow)->front().status.ok());
    commits = {{s, s, std::string(64, 'b'), 9, 4}};
  }
  state.SetItemsProcessed(state.iterations());
}
BENCHMARK(WholeLife)->ArgName("postgres")->Arg(0)->Arg(1)->UseRealTime();

}  // namespace
}  // namespace meshwright
