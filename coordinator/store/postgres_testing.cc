// SPDX-License-Identifier: Apache-2.0
#include "coordinator/store/postgres_testing.h"

#include <array>
#include <atomic>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <utility>

#include <absl/strings/ascii.h>
#include <absl/strings/str_cat.h>
#include <libpq-fe.h>
#include <unistd.h>

#include "common/base/check.h"
#include "common/base/status_macros.h"

namespace meshwright {
namespace {

constexpr int kNotInstalled = 77;

// Runs scripts/dev-postgres; returns what it prints.
absl::StatusOr<std::string> DevPostgres(const std::string& arguments) {
  const std::string command = absl::StrCat("'" MW_SOURCE_FOLDER "/scripts/dev-postgres' ", arguments);
  FILE* const pipe = ::popen(command.c_str(), "r");
  MW_CHECK(pipe != nullptr);
  std::string output;
  std::array<char, 256> buffer{};
  while (std::fgets(buffer.data(), buffer.size(), pipe) != nullptr) output += buffer.data();
  const int status = ::pclose(pipe);
  absl::StripAsciiWhitespace(&output);
  if (WIFEXITED(status) && WEXITSTATUS(status) == 0) return output;
  if (WIFEXITED(status) && WEXITSTATUS(status) == kNotInstalled) {
    return absl::NotFoundError("PostgreSQL is not installed (apt-get install postgresql-15)");
  }
  return absl::InternalError(absl::StrCat(command, " failed"));
}

}  // namespace

absl::StatusOr<std::unique_ptr<PostgresServer>> PostgresServer::Start(bool durable) {
  MW_ASSIGN_OR_RETURN(std::string folder,
                      DevPostgres(absl::StrCat("start --while ", ::getpid(), durable ? " --durable" : "")));
  std::unique_ptr<PostgresServer> server(new PostgresServer(std::move(folder)));
  MW_ASSIGN_OR_RETURN(server->url_, DevPostgres(absl::StrCat("url ", server->folder_)));
  return server;
}

PostgresServer::~PostgresServer() {
  Stop("immediate");
  std::error_code ignored;
  std::filesystem::remove_all(folder_, ignored);
}

void PostgresServer::Stop(const std::string& mode) {
  MW_CHECK(DevPostgres(absl::StrCat("stop ", folder_, " ", mode)).ok());
}

void PostgresServer::StartAgain() { MW_CHECK(DevPostgres(absl::StrCat("start --folder ", folder_)).ok()); }

absl::StatusOr<std::string> SharedTestPostgres() {
  if (const char* const url = std::getenv("MESHWRIGHT_TEST_POSTGRES"); url != nullptr && *url != '\0') return url;
  static const absl::StatusOr<std::unique_ptr<PostgresServer>> server = PostgresServer::Start();
  if (!server.ok()) return server.status();
  return (*server)->url();
}

PostgresSchema::PostgresSchema(const std::string& server_url) : server_url_(server_url) {
  static std::atomic<int> counter{0};
  name_ = absl::StrCat("test_", ::getpid(), "_", counter.fetch_add(1));
  RunSql(server_url_, absl::StrCat("CREATE SCHEMA ", name_));
  url_ = absl::StrCat(server_url_, server_url_.find('?') == std::string::npos ? "?" : "&", "options=-csearch_path%3D",
                      name_);
}

PostgresSchema::~PostgresSchema() {
  RunSql(server_url_, absl::StrCat("SET client_min_messages = warning; DROP SCHEMA ", name_, " CASCADE"));
}

std::string RunSql(const std::string& url, const std::string& sql) {
  PGconn* const connection = PQconnectdb(url.c_str());
  PGresult* const result = PQexec(connection, sql.c_str());
  const ExecStatusType status = PQresultStatus(result);
  if (status != PGRES_COMMAND_OK && status != PGRES_TUPLES_OK) {
    std::fprintf(stderr, "%s: %s\n", sql.c_str(), PQerrorMessage(connection));
    std::abort();
  }
  std::string value;
  if (PQntuples(result) > 0 && PQnfields(result) > 0) value = PQgetvalue(result, 0, 0);
  PQclear(result);
  PQfinish(connection);
  return value;
}

}  // namespace meshwright
