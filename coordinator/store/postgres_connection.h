// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <absl/time/time.h>

#include "coordinator/store/sql_database.h"

struct pg_conn;
struct pg_result;

namespace meshwright {

// What may be done about an error.
enum class PostgresFault {
  kFinal,      // nothing: the statement is refused
  kTransient,  // the same again (deadlock, serialization failure); nothing was changed
  kBroken,     // the same over a new connection; the statement may have taken effect or not
};

struct PostgresError {
  PostgresFault fault = PostgresFault::kFinal;
  absl::Status status;  // OK: no error
};

// Statements with ":name" parameters as PostgreSQL takes them: "$1" with the names in order.
struct PostgresStatement {
  std::string sql;
  std::vector<std::string> parameters;
};
PostgresStatement NumberParameters(const std::string& sql);

// A statement with what it is run with, all of which outlive the call.
struct PostgresCall {
  const std::string* name = nullptr;
  const PostgresStatement* statement = nullptr;
  const SqlParameters* parameters = nullptr;
};

// Where a connection string leads, to name it in messages: "PostgreSQL at host:port/database", never a password.
// InvalidArgument when it is none.
absl::StatusOr<std::string> DescribePostgresUrl(const std::string& url);

// Opens a session, or tries to: libpq's own PQstatus says which. `application`: how the server's lists name it.
pg_conn* ConnectToPostgres(const std::string& url, const char* application);

// One session. Statements are prepared when they are used first. No call waits for the server longer than until its
// deadline. Not thread-safe.
class PostgresConnection {
 public:
  static PostgresError Open(const std::string& url, const std::string& description,
                            std::unique_ptr<PostgresConnection>* connection);
  PostgresConnection(const PostgresConnection&) = delete;
  PostgresConnection& operator=(const PostgresConnection&) = delete;
  ~PostgresConnection();

  PostgresError Run(const PostgresCall& call, absl::Duration deadline, SqlResult* result);
  // Runs several in one round trip (libpq's pipeline), inside a transaction that is open: after an error none of the
  // rest has run. `results` gets one for each that ran.
  PostgresError RunAll(const std::vector<PostgresCall>& calls, absl::Duration deadline,
                       std::vector<SqlResult>* results);
  // BEGIN, COMMIT or ROLLBACK.
  PostgresError RunCommand(const std::string& command, absl::Duration deadline);
  // Applies the migrations that the database lacks, in one transaction. Coordinators that start at once wait for each
  // other (an advisory lock).
  PostgresError Migrate(absl::Duration deadline);
  // Alive as far as is known, and not left inside a transaction.
  bool IsReusable() const;

 private:
  PostgresConnection(pg_conn* connection, std::string description);
  PostgresError Execute(const std::string& sql, absl::Duration deadline, SqlResult* result);
  PostgresError Prepare(const PostgresCall& call, absl::Duration deadline);
  PostgresError Send(const PostgresCall& call);
  // Until all that was to be sent is. False when the deadline passed or the server is gone, as of the next two.
  bool Flush(absl::Duration deadline);
  bool WaitForInput(absl::Duration deadline);
  // `events`: of poll().
  bool WaitForSocket(int16_t events, absl::Duration deadline);
  // The results of what was sent; `result` gets the rows of the last.
  PostgresError Receive(absl::Duration deadline, SqlResult* result);
  PostgresError ReceiveAll(size_t calls, absl::Duration deadline, std::vector<SqlResult>* results);
  PostgresError ConnectionError(const std::string& what);
  PostgresError ResultError(const pg_result* result);

  pg_conn* const connection_;
  const std::string description_;
  std::set<std::string> prepared_;
};

}  // namespace meshwright
