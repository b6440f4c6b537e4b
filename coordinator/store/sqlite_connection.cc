// SPDX-License-Identifier: Apache-2.0
#include "coordinator/store/sqlite_connection.h"

#include <utility>
#include <vector>

#include <absl/strings/str_cat.h>
#include <sqlite3.h>

#include "common/base/check.h"
#include "common/base/network_file_system.h"
#include "common/base/status_macros.h"
#include "coordinator/store/sql_database.h"

namespace meshwright {

// Compiled in from sql/sqlite (see CMakeLists.txt).
const std::vector<std::pair<std::string, std::string>>& SqliteMigrations();

namespace {

constexpr int kBusyTimeoutMs = 10'000;
constexpr int64_t kApplicationId = 0x4d574a53;  // "MWJS": says that a file is a store of ours

absl::Status SqliteError(sqlite3* connection, const std::string& path) {
  const int code = sqlite3_extended_errcode(connection);
  const std::string message = absl::StrCat(path, ": ", sqlite3_errmsg(connection));
  if (code == SQLITE_CONSTRAINT_PRIMARYKEY || code == SQLITE_CONSTRAINT_UNIQUE) {
    return absl::AlreadyExistsError(message);
  }
  switch (code & 0xff) {
    case SQLITE_CONSTRAINT:
      return absl::FailedPreconditionError(message);
    case SQLITE_BUSY:
    case SQLITE_LOCKED:
      return absl::UnavailableError(message);
    case SQLITE_FULL:
      return absl::ResourceExhaustedError(message);
    case SQLITE_CORRUPT:
    case SQLITE_NOTADB:
      return absl::DataLossError(message);
    case SQLITE_READONLY:
    case SQLITE_CANTOPEN:
    case SQLITE_PERM:
      return absl::PermissionDeniedError(message);
    default:
      return absl::InternalError(message);
  }
}

}  // namespace

SqliteStatement::SqliteStatement(sqlite3* connection, sqlite3_stmt* statement, std::string path)
    : connection_(connection), statement_(statement), path_(std::move(path)) {}

SqliteStatement::SqliteStatement(SqliteStatement&& other) noexcept
    : connection_(other.connection_),
      statement_(std::exchange(other.statement_, nullptr)),
      path_(std::move(other.path_)) {}

SqliteStatement::~SqliteStatement() { sqlite3_finalize(statement_); }

int SqliteStatement::Parameter(const char* name) const {
  const int index = sqlite3_bind_parameter_index(statement_, name);
  MW_CHECK(index > 0);
  return index;
}

SqliteStatement& SqliteStatement::Bind(const char* name, int64_t value) {
  MW_CHECK(sqlite3_bind_int64(statement_, Parameter(name), value) == SQLITE_OK);
  return *this;
}

SqliteStatement& SqliteStatement::Bind(const char* name, const std::string& value) {
  MW_CHECK(sqlite3_bind_text64(statement_, Parameter(name), value.data(), value.size(), SQLITE_TRANSIENT,
                               SQLITE_UTF8) == SQLITE_OK);
  return *this;
}

SqliteStatement& SqliteStatement::BindNull(const char* name) {
  MW_CHECK(sqlite3_bind_null(statement_, Parameter(name)) == SQLITE_OK);
  return *this;
}

absl::StatusOr<bool> SqliteStatement::Step() {
  switch (sqlite3_step(statement_)) {
    case SQLITE_ROW:
      return true;
    case SQLITE_DONE:
      return false;
    default:
      return SqliteError(connection_, path_);
  }
}

int SqliteStatement::Columns() const { return sqlite3_column_count(statement_); }
int64_t SqliteStatement::Changes() const { return sqlite3_changes64(connection_); }

int64_t SqliteStatement::Integer(int column) const { return sqlite3_column_int64(statement_, column); }

std::string SqliteStatement::Text(int column) const {
  const auto* text = reinterpret_cast<const char*>(sqlite3_column_text(statement_, column));
  if (text == nullptr) return "";
  return {text, static_cast<size_t>(sqlite3_column_bytes(statement_, column))};
}

SqliteConnection::SqliteConnection(std::string path) : path_(std::move(path)) {
  statements_ = ParseSqlStatements(CommonStatements());
}

SqliteConnection::SqliteConnection(SqliteConnection&& other) noexcept
    : path_(std::move(other.path_)),
      connection_(std::exchange(other.connection_, nullptr)),
      statements_(std::move(other.statements_)) {}

SqliteConnection::~SqliteConnection() { sqlite3_close(connection_); }

absl::StatusOr<SqliteConnection> SqliteConnection::Open(const std::string& path) {
  SqliteConnection database(path);
  if (sqlite3_open_v2(path.c_str(), &database.connection_, SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE, nullptr) !=
      SQLITE_OK) {
    return SqliteError(database.connection_, path);
  }
  sqlite3_extended_result_codes(database.connection_, 1);
  sqlite3_busy_timeout(database.connection_, kBusyTimeoutMs);
  MW_RETURN_IF_ERROR(database.Execute("PRAGMA foreign_keys = OFF; PRAGMA synchronous = FULL;"));
  MW_RETURN_IF_ERROR(database.Migrate());
  MW_RETURN_IF_ERROR(database.Execute("PRAGMA foreign_keys = ON;"));
  // A write-ahead log needs memory that its processes share, which machines on a network share do not: one that takes
  // the file over from another would not see all of it. The classic journal is as safe, only slower.
  const char* journal = IsOnNetworkFileSystem(path) ? "DELETE" : "WAL";
  MW_RETURN_IF_ERROR(database.Execute(absl::StrCat("PRAGMA journal_mode = ", journal, ";")));
  return database;
}

absl::Status SqliteConnection::Execute(const std::string& sql) {
  if (sqlite3_exec(connection_, sql.c_str(), nullptr, nullptr, nullptr) != SQLITE_OK) {
    return SqliteError(connection_, path_);
  }
  return absl::OkStatus();
}

absl::StatusOr<int64_t> SqliteConnection::QueryInteger(const std::string& sql) {
  sqlite3_stmt* prepared = nullptr;
  if (sqlite3_prepare_v2(connection_, sql.c_str(), -1, &prepared, nullptr) != SQLITE_OK) {
    return SqliteError(connection_, path_);
  }
  SqliteStatement statement(connection_, prepared, path_);
  MW_ASSIGN_OR_RETURN(const bool row, statement.Step());
  MW_CHECK(row);
  return statement.Integer(0);
}

absl::StatusOr<SqliteStatement> SqliteConnection::Prepare(const std::string& name) {
  const auto found = statements_.find(name);
  MW_CHECK(found != statements_.end());
  sqlite3_stmt* prepared = nullptr;
  if (sqlite3_prepare_v2(connection_, found->second.c_str(), -1, &prepared, nullptr) != SQLITE_OK) {
    return SqliteError(connection_, path_);
  }
  return SqliteStatement(connection_, prepared, path_);
}

absl::Status SqliteConnection::Transaction(const std::function<absl::Status()>& body) {
  // IMMEDIATE takes the write lock now: a transaction that read first could otherwise fail to get it later.
  MW_RETURN_IF_ERROR(Execute("BEGIN IMMEDIATE"));
  absl::Status status = body();
  if (status.ok()) status = Execute("COMMIT");
  if (!status.ok() && sqlite3_get_autocommit(connection_) == 0) {
    sqlite3_exec(connection_, "ROLLBACK", nullptr, nullptr, nullptr);
  }
  return status;
}

absl::Status SqliteConnection::Migrate() {
  const auto& migrations = SqliteMigrations();
  return Transaction([&]() -> absl::Status {
    MW_ASSIGN_OR_RETURN(const int64_t application, QueryInteger("PRAGMA application_id"));
    MW_ASSIGN_OR_RETURN(const int64_t tables, QueryInteger("SELECT count(*) FROM sqlite_schema"));
    MW_ASSIGN_OR_RETURN(const int64_t version, QueryInteger("PRAGMA user_version"));
    if (application != kApplicationId && !(application == 0 && tables == 0)) {
      return absl::DataLossError(absl::StrCat(path_, ": a SQLite database, but not a job store"));
    }
    if (version < 0 || version > static_cast<int64_t>(migrations.size())) {
      return absl::FailedPreconditionError(absl::StrCat(path_, ": written by a newer version of the program (schema ",
                                                        version, ", this one knows ", migrations.size(), ")"));
    }
    if (version == static_cast<int64_t>(migrations.size())) return absl::OkStatus();
    for (size_t i = static_cast<size_t>(version); i < migrations.size(); ++i) {
      MW_RETURN_IF_ERROR(Execute(migrations[i].second));
    }
    return Execute(
        absl::StrCat("PRAGMA application_id = ", kApplicationId, "; PRAGMA user_version = ", migrations.size(), ";"));
  });
}

}  // namespace meshwright
