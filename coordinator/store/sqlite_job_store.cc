// SPDX-License-Identifier: Apache-2.0
#include "coordinator/store/sqlite_job_store.h"

#include <utility>
#include <vector>

#include <absl/strings/str_cat.h>

#include "common/base/mutex.h"
#include "common/base/status_macros.h"
#include "coordinator/store/sql_job_store.h"
#include "coordinator/store/sqlite_connection.h"

namespace meshwright {
namespace {

class SqliteDatabase : public SqlDatabase {
 public:
  SqliteDatabase(SqliteConnection connection, const Clock* clock) : clock_(clock), connection_(std::move(connection)) {}

  absl::StatusOr<SqlResult> Run(const std::string& name, const SqlParameters& parameters) override {
    const MutexLock lock(mutex_);
    return RunLocked(name, parameters);
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

  absl::StatusOr<absl::Time> Now() override { return clock_->Now(); }

 private:
  // Cancelled: one did not change exactly one row, and nothing was changed.
  absl::StatusOr<std::vector<SqlResult>> RunTransaction(const std::vector<SqlCall>& calls, bool each_changes_one_row) {
    const MutexLock lock(mutex_);
    std::vector<SqlResult> results;
    MW_RETURN_IF_ERROR(connection_.Transaction([&]() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) -> absl::Status {
      for (const SqlCall& call : calls) {
        MW_ASSIGN_OR_RETURN(SqlResult result, RunLocked(call.statement, call.parameters));
        if (each_changes_one_row && result.changed != 1) return absl::CancelledError("rolled back");
        results.push_back(std::move(result));
      }
      return absl::OkStatus();
    }));
    return results;
  }

  absl::StatusOr<SqlResult> RunLocked(const std::string& name, const SqlParameters& parameters)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) {
    MW_ASSIGN_OR_RETURN(SqliteStatement statement, connection_.Prepare(name));
    for (const auto& [parameter, value] : parameters) {
      const std::string bound_name = absl::StrCat(":", parameter);
      if (const auto* integer = std::get_if<int64_t>(&value)) {
        statement.Bind(bound_name.c_str(), *integer);
      } else if (const auto* text = std::get_if<std::string>(&value)) {
        statement.Bind(bound_name.c_str(), *text);
      } else {
        statement.BindNull(bound_name.c_str());
      }
    }
    SqlResult result;
    while (true) {
      MW_ASSIGN_OR_RETURN(const bool row, statement.Step());
      if (!row) break;
      std::vector<std::string> values;
      values.reserve(static_cast<size_t>(statement.Columns()));
      for (int column = 0; column < statement.Columns(); ++column) values.push_back(statement.Text(column));
      result.rows.emplace_back(std::move(values));
    }
    result.changed = statement.Changes();
    return result;
  }

  const Clock* const clock_;
  Mutex mutex_;
  SqliteConnection connection_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace

absl::StatusOr<std::unique_ptr<JobStore>> OpenSqliteJobStore(const std::string& path, const Clock* clock,
                                                             const WrapSqlDatabase& wrap) {
  static const RealClock real_clock;
  MW_ASSIGN_OR_RETURN(SqliteConnection connection, SqliteConnection::Open(path));
  std::unique_ptr<SqlDatabase> database =
      std::make_unique<SqliteDatabase>(std::move(connection), clock == nullptr ? &real_clock : clock);
  if (wrap) database = wrap(std::move(database));
  return std::make_unique<SqlJobStore>(std::move(database));
}

}  // namespace meshwright
