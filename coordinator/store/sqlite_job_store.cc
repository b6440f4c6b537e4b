#include "coordinator/store/sqlite_job_store.h"

#include <mutex>
#include <utility>

#include <absl/strings/str_cat.h>

#include "common/base/status_macros.h"
#include "coordinator/store/sql_job_store.h"
#include "coordinator/store/sqlite_connection.h"

namespace meshwright {
namespace {

class SqliteDatabase : public SqlDatabase {
 public:
  SqliteDatabase(SqliteConnection connection, const Clock* clock) : clock_(clock), connection_(std::move(connection)) {}

  absl::StatusOr<SqlResult> Run(const std::string& name, const SqlParameters& parameters) override {
    const std::lock_guard<std::mutex> lock(mutex_);
    return RunLocked(name, parameters);
  }

  absl::StatusOr<bool> RunTogether(const std::vector<SqlCall>& calls) override {
    const std::lock_guard<std::mutex> lock(mutex_);
    bool all_changed = true;
    const absl::Status status = connection_.Transaction([&]() -> absl::Status {
      for (const SqlCall& call : calls) {
        MW_ASSIGN_OR_RETURN(const SqlResult result, RunLocked(call.statement, call.parameters));
        all_changed = result.changed == 1;
        if (!all_changed) return absl::CancelledError("rolled back");
      }
      return absl::OkStatus();
    });
    if (!all_changed) return false;
    MW_RETURN_IF_ERROR(status);
    return true;
  }

  absl::StatusOr<absl::Time> Now() override { return clock_->Now(); }

 private:
  absl::StatusOr<SqlResult> RunLocked(const std::string& name, const SqlParameters& parameters) {
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
  std::mutex mutex_;
  SqliteConnection connection_;
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
