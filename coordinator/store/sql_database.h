// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <absl/time/time.h>

namespace meshwright {

using SqlValue = std::variant<std::nullopt_t, int64_t, std::string>;
using SqlParameters = std::vector<std::pair<std::string, SqlValue>>;  // "name" for ":name" in the statement

inline SqlValue NullIfEmpty(const std::string& text) { return text.empty() ? SqlValue(std::nullopt) : SqlValue(text); }

class SqlRow {
 public:
  explicit SqlRow(std::vector<std::string> values) : values_(std::move(values)) {}
  size_t Columns() const { return values_.size(); }
  const std::string& Text(size_t column) const { return values_[column]; }  // NULL reads as ""
  int64_t Integer(size_t column) const;                                     // NULL reads as 0
  bool IsNull(size_t column) const { return values_[column].empty(); }      // or ""
  absl::Time Time(size_t column) const { return absl::FromUnixMicros(Integer(column)); }

 private:
  std::vector<std::string> values_;
};

struct SqlResult {
  std::vector<SqlRow> rows;
  int64_t changed = 0;  // rows that an INSERT, UPDATE or DELETE changed
};

struct SqlCall {
  std::string statement;
  SqlParameters parameters;
};

// What SqlJobStore needs of a database. Thread-safe.
class SqlDatabase {
 public:
  virtual ~SqlDatabase() = default;
  // Runs one statement of the sql folder as one durable transaction. Errors are those of JobStore.
  virtual absl::StatusOr<SqlResult> Run(const std::string& statement, const SqlParameters& parameters) = 0;
  // Runs several, each of which must change exactly one row, as one durable transaction. False: one of them did not,
  // and nothing was changed.
  virtual absl::StatusOr<bool> RunTogether(const std::vector<SqlCall>& calls) = 0;
  // Runs several as one durable transaction, whatever each of them changes.
  virtual absl::StatusOr<std::vector<SqlResult>> RunAll(const std::vector<SqlCall>& calls) = 0;
  virtual absl::StatusOr<absl::Time> Now() = 0;
};

// Puts another database around the one that a store was opened with, for instance to measure it.
using WrapSqlDatabase = std::function<std::unique_ptr<SqlDatabase>(std::unique_ptr<SqlDatabase>)>;

// Cuts files of "-- name: x" sections into name -> SQL.
std::map<std::string, std::string> ParseSqlStatements(const std::vector<std::pair<std::string, std::string>>& files);

// Compiled in from sql/common (see CMakeLists.txt).
const std::vector<std::pair<std::string, std::string>>& CommonStatements();

}  // namespace meshwright
