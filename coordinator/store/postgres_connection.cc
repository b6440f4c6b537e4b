// SPDX-License-Identifier: Apache-2.0
#include "coordinator/store/postgres_connection.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdint>
#include <cstdlib>
#include <iterator>
#include <utility>

#include <absl/strings/ascii.h>
#include <absl/strings/str_cat.h>
#include <libpq-fe.h>
#include <poll.h>

#include "common/base/check.h"
#include "common/base/clock.h"

namespace meshwright {

// Compiled in from sql/postgres (see CMakeLists.txt).
const std::vector<std::pair<std::string, std::string>>& PostgresMigrations();

namespace {

constexpr int64_t kMigrationLock = 0x4d574a53;  // the key of the advisory lock: "MWJS", as in SQLite files

// What comes later counts, so the connection string may say otherwise. A peer that vanished is noticed after 10 s.
constexpr const char* kKeywords[] = {"connect_timeout",
                                     "tcp_user_timeout",
                                     "target_session_attrs",
                                     "application_name",
                                     "dbname",
                                     "client_encoding",
                                     nullptr};
constexpr char kApplication[] = "meshwright";

std::array<const char*, std::size(kKeywords)> ValuesOf(const std::string& url, const char* application) {
  return {"5", "10000", "read-write", application, url.c_str(), "UTF8", nullptr};
}

using ResultOwner = std::unique_ptr<PGresult, void (*)(PGresult*)>;

bool StartsWith(const std::string& text, const char* prefix) { return text.rfind(prefix, 0) == 0; }

// https://www.postgresql.org/docs/15/errcodes-appendix.html
PostgresError Classify(const std::string& code, const std::string& message) {
  if (code == "40001" || code == "40P01" || code == "55P03") {
    return {PostgresFault::kTransient, absl::UnavailableError(message)};
  }
  // The session ends (57P..), the server is a standby now (25006), or the session's prepared statements are not what
  // they were (26000, 0A000).
  if (StartsWith(code, "08") || StartsWith(code, "57P") || code == "25006" || code == "26000" || code == "0A000") {
    return {PostgresFault::kBroken, absl::UnavailableError(message)};
  }
  const auto final_error = [](absl::Status status) { return PostgresError{PostgresFault::kFinal, std::move(status)}; };
  if (code == "23505") return final_error(absl::AlreadyExistsError(message));
  if (StartsWith(code, "23")) return final_error(absl::FailedPreconditionError(message));
  if (StartsWith(code, "22")) return final_error(absl::InvalidArgumentError(message));
  if (code == "42501" || StartsWith(code, "28")) return final_error(absl::PermissionDeniedError(message));
  if (StartsWith(code, "53")) return final_error(absl::ResourceExhaustedError(message));
  if (StartsWith(code, "XX001") || StartsWith(code, "XX002")) return final_error(absl::DataLossError(message));
  if (code == "57014") return final_error(absl::UnavailableError(message));
  return final_error(absl::InternalError(absl::StrCat(message, " (SQLSTATE ", code, ")")));
}

const SqlValue& ValueOf(const PostgresCall& call, const std::string& name) {
  const auto given = std::find_if(call.parameters->begin(), call.parameters->end(),
                                  [&](const auto& parameter) { return parameter.first == name; });
  MW_CHECK(given != call.parameters->end());
  return given->second;
}

// libpq would silently end a text at a zero byte.
PostgresError CheckTexts(const PostgresCall& call) {
  for (const auto& [name, value] : *call.parameters) {
    const auto* const text = std::get_if<std::string>(&value);
    if (text == nullptr || text->find('\0') == std::string::npos) continue;
    return {PostgresFault::kFinal, absl::InvalidArgumentError(absl::StrCat(name, " has a zero byte, expected text"))};
  }
  return {};
}

}  // namespace

PostgresStatement NumberParameters(const std::string& sql) {
  PostgresStatement statement;
  for (size_t at = 0; at < sql.size();) {
    size_t end = at + 1;
    if (sql[at] == ':') {
      while (end < sql.size() && (absl::ascii_islower(static_cast<unsigned char>(sql[end])) || sql[end] == '_')) ++end;
    }
    if (end == at + 1) {
      statement.sql += sql[at];
    } else {
      const std::string name = sql.substr(at + 1, end - at - 1);
      auto found = std::find(statement.parameters.begin(), statement.parameters.end(), name);
      if (found == statement.parameters.end()) found = statement.parameters.insert(found, name);
      absl::StrAppend(&statement.sql, "$", 1 + (found - statement.parameters.begin()));
    }
    at = end;
  }
  return statement;
}

absl::StatusOr<std::string> DescribePostgresUrl(const std::string& url) {
  char* error = nullptr;
  PQconninfoOption* const options = PQconninfoParse(url.c_str(), &error);
  // libpq's own message may repeat the whole string, password included.
  PQfreemem(error);
  if (options == nullptr) {
    return absl::InvalidArgumentError(
        "not a connection string of PostgreSQL, expected postgresql://USER@HOST:PORT/DATABASE");
  }
  std::map<std::string, std::string> values;
  for (const PQconninfoOption* option = options; option->keyword != nullptr; ++option) {
    if (option->val != nullptr) values[option->keyword] = option->val;
  }
  PQconninfoFree(options);
  const auto value_or = [&](const char* key, const char* otherwise) {
    return values[key].empty() ? std::string(otherwise) : values[key];
  };
  return absl::StrCat("PostgreSQL at ", value_or("host", "localhost"), ":", value_or("port", "5432"), "/",
                      value_or("dbname", ""));
}

pg_conn* ConnectToPostgres(const std::string& url, const char* application) {
  return PQconnectdbParams(kKeywords, ValuesOf(url, application).data(), /*expand_dbname=*/1);
}

PostgresConnection::PostgresConnection(pg_conn* connection, std::string description)
    : connection_(connection), description_(std::move(description)) {}

PostgresConnection::~PostgresConnection() { PQfinish(connection_); }

PostgresError PostgresConnection::Open(const std::string& url, const std::string& description,
                                       std::unique_ptr<PostgresConnection>* connection) {
  std::unique_ptr<PostgresConnection> opened(new PostgresConnection(ConnectToPostgres(url, kApplication), description));
  if (PQstatus(opened->connection_) != CONNECTION_OK) {
    PostgresError error = opened->ConnectionError("cannot connect");
    // A server that answers, and still lets nobody in, will not do so a moment later: a wrong password or database.
    const PGPing ping = PQpingParams(kKeywords, ValuesOf(url, kApplication).data(), /*expand_dbname=*/1);
    if (ping == PQPING_OK) {
      error = {PostgresFault::kFinal, absl::PermissionDeniedError(error.status.message())};
    } else if (ping == PQPING_NO_ATTEMPT) {
      error = {PostgresFault::kFinal, absl::InvalidArgumentError(error.status.message())};
    }
    return error;
  }
  PQsetNoticeProcessor(
      opened->connection_, [](void*, const char*) {}, nullptr);
  *connection = std::move(opened);
  return {};
}

bool PostgresConnection::IsReusable() const {
  return PQstatus(connection_) == CONNECTION_OK && PQtransactionStatus(connection_) == PQTRANS_IDLE &&
         PQpipelineStatus(connection_) == PQ_PIPELINE_OFF;
}

PostgresError PostgresConnection::ConnectionError(const std::string& what) {
  std::string reason = PQerrorMessage(connection_);
  absl::StripTrailingAsciiWhitespace(&reason);
  return {PostgresFault::kBroken,
          absl::UnavailableError(absl::StrCat(description_, ": ", what, reason.empty() ? "" : ": ", reason))};
}

PostgresError PostgresConnection::ResultError(const pg_result* result) {
  const char* const code = PQresultErrorField(result, PG_DIAG_SQLSTATE);
  // No code: libpq itself gave up, since the connection is gone.
  if (code == nullptr || PQstatus(connection_) != CONNECTION_OK) return ConnectionError("the connection broke");
  const char* const primary = PQresultErrorField(result, PG_DIAG_MESSAGE_PRIMARY);
  return Classify(code, absl::StrCat(description_, ": ", primary == nullptr ? "unknown error" : primary));
}

bool PostgresConnection::WaitForSocket(int16_t events, absl::Duration deadline) {
  const absl::Duration left = deadline - SystemClock().Uptime();
  if (left <= absl::ZeroDuration()) return false;
  pollfd socket = {.fd = PQsocket(connection_), .events = events, .revents = 0};
  const int ready = ::poll(&socket, 1, static_cast<int>(absl::ToInt64Milliseconds(left)) + 1);
  if (ready < 0) return errno == EINTR;
  const bool has_input = ready > 0 && (socket.revents & ~POLLOUT) != 0;
  return !has_input || PQconsumeInput(connection_) != 0;
}

bool PostgresConnection::WaitForInput(absl::Duration deadline) {
  while (PQisBusy(connection_) != 0) {
    if (!WaitForSocket(POLLIN, deadline)) return false;
  }
  return true;
}

PostgresError PostgresConnection::Receive(absl::Duration deadline, SqlResult* result) {
  PostgresError error;
  while (true) {
    if (!WaitForInput(deadline)) return ConnectionError("no answer");
    const ResultOwner got(PQgetResult(connection_), &PQclear);
    if (got == nullptr) return error;
    const ExecStatusType status = PQresultStatus(got.get());
    if (status == PGRES_PIPELINE_ABORTED) continue;
    if (status != PGRES_COMMAND_OK && status != PGRES_TUPLES_OK) {
      error = ResultError(got.get());
      if (error.fault == PostgresFault::kBroken) return error;
      continue;
    }
    result->rows.clear();
    const int columns = PQnfields(got.get());
    for (int row = 0; row < PQntuples(got.get()); ++row) {
      std::vector<std::string> values;
      values.reserve(static_cast<size_t>(columns));
      for (int column = 0; column < columns; ++column) {
        values.emplace_back(PQgetvalue(got.get(), row, column),
                            static_cast<size_t>(PQgetlength(got.get(), row, column)));
      }
      result->rows.emplace_back(std::move(values));
    }
    result->changed = std::atoll(PQcmdTuples(got.get()));
  }
}

PostgresError PostgresConnection::Execute(const std::string& sql, absl::Duration deadline, SqlResult* result) {
  if (PQsendQuery(connection_, sql.c_str()) == 0) return ConnectionError("cannot send");
  return Receive(deadline, result);
}

PostgresError PostgresConnection::Prepare(const PostgresCall& call, absl::Duration deadline) {
  if (prepared_.count(*call.name) > 0) return {};
  if (PQsendPrepare(connection_, call.name->c_str(), call.statement->sql.c_str(), 0, nullptr) == 0) {
    return ConnectionError("cannot send");
  }
  SqlResult nothing;
  PostgresError error = Receive(deadline, &nothing);
  if (error.status.ok()) prepared_.insert(*call.name);
  return error;
}

PostgresError PostgresConnection::Send(const PostgresCall& call) {
  std::vector<std::string> texts(call.statement->parameters.size());
  std::vector<const char*> values(texts.size(), nullptr);
  for (size_t i = 0; i < values.size(); ++i) {
    const SqlValue& given = ValueOf(call, call.statement->parameters[i]);
    if (std::holds_alternative<std::nullopt_t>(given)) continue;
    const auto* const integer = std::get_if<int64_t>(&given);
    texts[i] = integer != nullptr ? absl::StrCat(*integer) : std::get<std::string>(given);
    values[i] = texts[i].c_str();
  }
  const int sent = PQsendQueryPrepared(connection_, call.name->c_str(), static_cast<int>(values.size()), values.data(),
                                       nullptr, nullptr, /*resultFormat=*/0);
  return sent == 0 ? ConnectionError("cannot send") : PostgresError();
}

PostgresError PostgresConnection::Run(const PostgresCall& call, absl::Duration deadline, SqlResult* result) {
  PostgresError error = CheckTexts(call);
  if (error.status.ok()) error = Prepare(call, deadline);
  if (error.status.ok()) error = Send(call);
  return error.status.ok() ? Receive(deadline, result) : error;
}

PostgresError PostgresConnection::RunAll(const std::vector<PostgresCall>& calls, absl::Duration deadline,
                                         std::vector<SqlResult>* results) {
  for (const PostgresCall& call : calls) {
    PostgresError error = CheckTexts(call);
    if (error.status.ok()) error = Prepare(call, deadline);
    if (!error.status.ok()) return error;
  }
  // A server whose results nobody reads takes no more statements: sending must not wait for it.
  if (PQsetnonblocking(connection_, 1) != 0 || PQenterPipelineMode(connection_) == 0) {
    return ConnectionError("cannot send");
  }
  for (const PostgresCall& call : calls) {
    PostgresError error = Send(call);
    if (!error.status.ok()) return error;
  }
  if (PQpipelineSync(connection_) == 0 || !Flush(deadline)) return ConnectionError("cannot send");
  PostgresError error = ReceiveAll(calls.size(), deadline, results);
  if (error.fault == PostgresFault::kBroken) return error;
  if (PQexitPipelineMode(connection_) == 0 || PQsetnonblocking(connection_, 0) != 0) {
    return ConnectionError("the connection broke");
  }
  return error;
}

bool PostgresConnection::Flush(absl::Duration deadline) {
  while (true) {
    const int left = PQflush(connection_);
    if (left <= 0) return left == 0;
    if (!WaitForSocket(POLLIN | POLLOUT, deadline)) return false;
  }
}

// What follows an error has not run: the server says so of each, and then that it is in step again.
PostgresError PostgresConnection::ReceiveAll(size_t calls, absl::Duration deadline, std::vector<SqlResult>* results) {
  PostgresError error;
  for (size_t i = 0; i < calls; ++i) {
    SqlResult result;
    PostgresError received = Receive(deadline, &result);
    if (received.fault == PostgresFault::kBroken) return received;
    if (!error.status.ok()) continue;
    error = std::move(received);
    if (error.status.ok()) results->push_back(std::move(result));
  }
  if (!WaitForInput(deadline)) return ConnectionError("no answer");
  const ResultOwner in_step(PQgetResult(connection_), &PQclear);
  if (PQresultStatus(in_step.get()) != PGRES_PIPELINE_SYNC) return ConnectionError("the connection broke");
  return error;
}

PostgresError PostgresConnection::RunCommand(const std::string& command, absl::Duration deadline) {
  SqlResult ignored;
  return Execute(command, deadline, &ignored);
}

PostgresError PostgresConnection::Migrate(absl::Duration deadline) {
  SqlResult result;
  PostgresError error =
      Execute(absl::StrCat("BEGIN; SELECT pg_advisory_xact_lock(", kMigrationLock,
                           "); CREATE TABLE IF NOT EXISTS meshwright_migrations (number BIGINT PRIMARY "
                           "KEY, file TEXT NOT NULL, applied_at TIMESTAMPTZ NOT NULL DEFAULT now()); "
                           "SELECT coalesce(max(number), 0) FROM meshwright_migrations"),
              deadline, &result);
  if (!error.status.ok()) return error;
  const auto& migrations = PostgresMigrations();
  const auto newest = static_cast<int64_t>(migrations.size());
  const int64_t version = result.rows.front().Integer(0);
  if (version > newest) {
    return {PostgresFault::kFinal, absl::FailedPreconditionError(absl::StrCat(
                                       description_, ": written by a newer version of the program (schema ", version,
                                       ", this one knows ", newest, ")"))};
  }
  for (int64_t number = version + 1; number <= newest; ++number) {
    const auto& [file, sql] = migrations[static_cast<size_t>(number - 1)];
    error = Execute(
        absl::StrCat(sql, "\nINSERT INTO meshwright_migrations (number, file) VALUES (", number, ", '", file, "')"),
        deadline, &result);
    if (!error.status.ok()) return error;
  }
  return Execute("COMMIT", deadline, &result);
}

}  // namespace meshwright
