// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <string>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

struct sqlite3;
struct sqlite3_stmt;

namespace meshwright {

// One prepared statement being run. Values are bound by name (":id"); text and integers are all that the store needs.
class SqliteStatement {
 public:
  SqliteStatement(SqliteStatement&& other) noexcept;
  SqliteStatement(const SqliteStatement&) = delete;
  SqliteStatement& operator=(const SqliteStatement&) = delete;
  SqliteStatement& operator=(SqliteStatement&&) = delete;
  ~SqliteStatement();

  SqliteStatement& Bind(const char* name, int64_t value);
  SqliteStatement& Bind(const char* name, const std::string& value);
  SqliteStatement& BindNull(const char* name);

  // Goes to the next row: false when there is none.
  absl::StatusOr<bool> Step();
  // How many rows the statement that ran last changed.
  int64_t Changes() const;

  int Columns() const;
  int64_t Integer(int column) const;
  std::string Text(int column) const;  // NULL reads as ""

 private:
  friend class SqliteConnection;
  SqliteStatement(sqlite3* connection, sqlite3_stmt* statement, std::string path);
  int Parameter(const char* name) const;

  sqlite3* connection_;
  sqlite3_stmt* statement_;
  std::string path_;
};

// A SQLite database file with the store's settings: write-ahead log, every commit synced to disk (synchronous = FULL),
// foreign keys checked, waits up to 10 s for another process's lock. Opening it applies the migrations that it lacks,
// in one transaction; the number applied is PRAGMA user_version. Not thread-safe.
class SqliteConnection {
 public:
  static absl::StatusOr<SqliteConnection> Open(const std::string& path);
  SqliteConnection(SqliteConnection&& other) noexcept;
  SqliteConnection(const SqliteConnection&) = delete;
  SqliteConnection& operator=(const SqliteConnection&) = delete;
  SqliteConnection& operator=(SqliteConnection&&) = delete;
  ~SqliteConnection();

  // The statement of this name in sql/common or sql/sqlite.
  absl::StatusOr<SqliteStatement> Prepare(const std::string& name);
  // Runs `body` in one transaction: committed when it returns OK, rolled back otherwise.
  absl::Status Transaction(const std::function<absl::Status()>& body);

 private:
  explicit SqliteConnection(std::string path);
  absl::Status Execute(const std::string& sql);
  absl::StatusOr<int64_t> QueryInteger(const std::string& sql);
  absl::Status Migrate();

  std::string path_;
  sqlite3* connection_ = nullptr;
  std::map<std::string, std::string> statements_;
};

}  // namespace meshwright
