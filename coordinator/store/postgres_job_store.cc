// SPDX-License-Identifier: Apache-2.0
#include "coordinator/store/postgres_job_store.h"

#include <algorithm>
#include <atomic>
#include <functional>
#include <map>
#include <utility>
#include <vector>

#include <absl/strings/str_cat.h>
#include <absl/time/clock.h>

#include "common/base/check.h"
#include "common/base/clock.h"
#include "common/base/mutex.h"
#include "common/base/status_macros.h"
#include "coordinator/store/postgres_connection.h"
#include "coordinator/store/sql_job_store.h"

namespace meshwright {

// Compiled in from sql/postgres (see CMakeLists.txt).
const std::vector<std::pair<std::string, std::string>>& PostgresStatements();

namespace {

constexpr int kTransientAttempts = 10;
constexpr absl::Duration kFirstPause = absl::Milliseconds(20);
constexpr absl::Duration kLongestPause = absl::Seconds(1);

// "/*postgres: X */" -> "X"
std::string WithPostgresParts(const std::string& sql) {
  constexpr char kBegin[] = "/*postgres: ";
  std::string result = sql;
  for (size_t at = result.find(kBegin); at != std::string::npos; at = result.find(kBegin, at)) {
    const size_t end = result.find("*/", at);
    MW_CHECK(end != std::string::npos);
    result.erase(end, 2);
    result.erase(at, sizeof(kBegin) - 1);
  }
  return result;
}

class PostgresDatabase : public SqlDatabase {
 public:
  PostgresDatabase(std::string url, std::string description, const PostgresOptions& options)
      : url_(std::move(url)), description_(std::move(description)), options_(options) {
    for (const auto& files : {CommonStatements(), PostgresStatements()}) {
      for (const auto& [name, sql] : ParseSqlStatements(files)) {
        statements_[name] = NumberParameters(WithPostgresParts(sql));
      }
    }
  }

  absl::Status Migrate() {
    return Attempt(
        [](PostgresConnection& connection, absl::Duration deadline) { return connection.Migrate(deadline); });
  }

  absl::StatusOr<SqlResult> Run(const std::string& name, const SqlParameters& parameters) override {
    const auto statement = statements_.find(name);
    MW_CHECK(statement != statements_.end());
    SqlResult result;
    MW_RETURN_IF_ERROR(Attempt([&](PostgresConnection& connection, absl::Duration deadline) {
      return connection.Run({&name, &statement->second, &parameters}, deadline, &result);
    }));
    return result;
  }

  absl::StatusOr<bool> RunTogether(const std::vector<SqlCall>& calls) override {
    const absl::Status status = RunTransaction(calls, /*each_changes_one_row=*/true).status();
    if (absl::IsCancelled(status)) return false;
    MW_RETURN_IF_ERROR(status);
    return true;
  }

  absl::StatusOr<std::vector<SqlResult>> RunAll(const std::vector<SqlCall>& calls) override {
    return RunTransaction(calls, /*each_changes_one_row=*/false);
  }

  absl::StatusOr<absl::Time> Now() override {
    MW_ASSIGN_OR_RETURN(const SqlResult result, Run("now", {}));
    return result.rows.front().Time(0);
  }

 private:
  // Cancelled: one did not change exactly one row, and nothing was changed.
  absl::StatusOr<std::vector<SqlResult>> RunTransaction(const std::vector<SqlCall>& calls, bool each_changes_one_row) {
    std::vector<PostgresCall> prepared;
    prepared.reserve(calls.size());
    for (const SqlCall& call : calls) {
      prepared.push_back({&call.statement, &statements_.at(call.statement), &call.parameters});
    }
    std::vector<SqlResult> results;
    bool all_changed = true;
    MW_RETURN_IF_ERROR(Attempt([&](PostgresConnection& connection, absl::Duration deadline) {
      results.clear();
      PostgresError error = connection.RunCommand("BEGIN", deadline);
      if (error.status.ok()) error = connection.RunAll(prepared, deadline, &results);
      if (error.fault == PostgresFault::kBroken) return error;
      all_changed = !each_changes_one_row || std::all_of(results.begin(), results.end(),
                                                         [](const SqlResult& result) { return result.changed == 1; });
      if (error.status.ok() && all_changed) return connection.RunCommand("COMMIT", deadline);
      const PostgresError rollback = connection.RunCommand("ROLLBACK", deadline);
      return error.status.ok() ? rollback : error;
    }));
    if (!all_changed) return absl::CancelledError("rolled back");
    return results;
  }

  using Action = std::function<PostgresError(PostgresConnection&, absl::Duration deadline)>;

  // Runs the action until it succeeds, is refused, or retry_deadline ends.
  absl::Status Attempt(const Action& action) {
    const absl::Duration deadline = SystemClock().Uptime() + options_.retry_deadline;
    std::unique_ptr<PostgresConnection> connection;
    if (!TakeTurn(deadline, &connection)) {
      return absl::UnavailableError(
          absl::StrCat(description_, ": all ", options_.connections, " connections are busy"));
    }
    int transient_errors = 0;
    int refusals = 0;
    absl::Duration pause = kFirstPause;
    PostgresError error;
    while (true) {
      const bool is_new = connection == nullptr;
      if (is_new) {
        error = PostgresConnection::Open(url_, description_, &connection);
        // A server that is starting may refuse one moment and answer the next. Only one that never let anybody in, and
        // refuses twice, means it.
        const bool refused = connection == nullptr && error.fault == PostgresFault::kFinal;
        if (refused && (connected_ || ++refusals < 2)) {
          error = {PostgresFault::kBroken, absl::UnavailableError(error.status.message())};
        }
      }
      if (connection != nullptr) {
        connected_ = true;
        error = action(*connection, deadline);
        if (error.status.ok()) break;
      }
      if (error.fault == PostgresFault::kBroken) connection.reset();
      if (error.fault == PostgresFault::kFinal) break;
      if (error.fault == PostgresFault::kTransient && ++transient_errors == kTransientAttempts) break;
      if (SystemClock().Uptime() + pause >= deadline) break;
      // A connection that lay in the pool may have died long ago: no reason to wait before making a new one.
      if (error.fault == PostgresFault::kBroken && !is_new) continue;
      absl::SleepFor(pause);
      pause = std::min(2 * pause, kLongestPause);
    }
    EndTurn(std::move(connection));
    return error.status;
  }

  // Waits until fewer than the allowed number of calls are under way; `connection` is an idle one if there is any.
  bool TakeTurn(absl::Duration deadline, std::unique_ptr<PostgresConnection>* connection) {
    MutexLock lock(mutex_);
    while (running_ >= options_.connections) {
      const absl::Duration left = deadline - SystemClock().Uptime();
      if (left <= absl::ZeroDuration()) return false;
      freed_.WaitFor(lock, absl::ToChronoNanoseconds(left));
    }
    ++running_;
    if (!idle_.empty()) {
      *connection = std::move(idle_.back());
      idle_.pop_back();
    }
    return true;
  }

  void EndTurn(std::unique_ptr<PostgresConnection> connection) {
    {
      const MutexLock lock(mutex_);
      --running_;
      if (connection != nullptr && connection->IsReusable()) idle_.push_back(std::move(connection));
    }
    freed_.NotifyOne();
  }

  const std::string url_;
  const std::string description_;
  const PostgresOptions options_;
  std::map<std::string, PostgresStatement> statements_;

  std::atomic<bool> connected_{false};  // some time, with these credentials
  Mutex mutex_;
  ConditionVariable freed_;
  std::vector<std::unique_ptr<PostgresConnection>> idle_ ABSL_GUARDED_BY(mutex_);
  int running_ ABSL_GUARDED_BY(mutex_) = 0;
};

}  // namespace

absl::StatusOr<std::unique_ptr<JobStore>> OpenPostgresJobStore(const std::string& url, const PostgresOptions& options,
                                                               const WrapSqlDatabase& wrap) {
  MW_ASSIGN_OR_RETURN(std::string description, DescribePostgresUrl(url));
  auto database = std::make_unique<PostgresDatabase>(url, std::move(description), options);
  MW_RETURN_IF_ERROR(database->Migrate());
  if (!wrap) return std::make_unique<SqlJobStore>(std::move(database));
  return std::make_unique<SqlJobStore>(wrap(std::move(database)));
}

}  // namespace meshwright
