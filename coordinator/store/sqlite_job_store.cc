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
      for (int column = 0; column < statement.Columns(); ++column) values.push_back(statement.Text(column));
      result.rows.emplace_back(std::move(values));
    }
    result.changed = statement.Changes();
    return result;
  }

  absl::StatusOr<absl::Time> Now() override { return clock_->Now(); }

 private:
  const Clock* const clock_;
  std::mutex mutex_;
  SqliteConnection connection_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<JobStore>> OpenSqliteJobStore(const std::string& path, const Clock* clock) {
  static const RealClock real_clock;
  MW_ASSIGN_OR_RETURN(SqliteConnection connection, SqliteConnection::Open(path));
  return std::make_unique<SqlJobStore>(
      std::make_unique<SqliteDatabase>(std::move(connection), clock == nullptr ? &real_clock : clock));
}

}  // namespace meshwright
