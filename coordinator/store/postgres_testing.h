// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>

#include <absl/status/statusor.h>

namespace meshwright {

// A PostgreSQL server of the test's own, made by scripts/dev-postgres; gone with the object, or with the process.
class PostgresServer {
 public:
  // NotFound when PostgreSQL is not installed. `durable`: it syncs to the disk, as a server for others would.
  static absl::StatusOr<std::unique_ptr<PostgresServer>> Start(bool durable = false);
  PostgresServer(const PostgresServer&) = delete;
  PostgresServer& operator=(const PostgresServer&) = delete;
  ~PostgresServer();

  const std::string& url() const { return url_; }
  // `mode` as pg_ctl's: "fast" ends sessions in good order, "immediate" is a crash.
  void Stop(const std::string& mode);
  void StartAgain();

 private:
  explicit PostgresServer(std::string folder) : folder_(std::move(folder)) {}
  std::string folder_;
  std::string url_;
};

// The server that all tests of a process share: MESHWRIGHT_TEST_POSTGRES when it is set, else a PostgresServer.
absl::StatusOr<std::string> SharedTestPostgres();

// An empty schema in a server, dropped with the object: each test has the database for itself.
class PostgresSchema {
 public:
  explicit PostgresSchema(const std::string& server_url);
  PostgresSchema(const PostgresSchema&) = delete;
  PostgresSchema& operator=(const PostgresSchema&) = delete;
  ~PostgresSchema();
  const std::string& url() const { return url_; }

 private:
  std::string server_url_;
  std::string name_;
  std::string url_;
};

// Runs SQL behind the store's back; returns the first value of its result.
std::string RunSql(const std::string& url, const std::string& sql);

}  // namespace meshwright
