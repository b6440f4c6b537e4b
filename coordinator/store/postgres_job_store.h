// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>

#include <absl/status/statusor.h>
#include <absl/time/time.h>

#include "coordinator/store/job_store.h"
#include "coordinator/store/sql_database.h"

namespace meshwright {

struct PostgresOptions {
  int connections = 8;  // at most this many statements at once; connections are made when they are needed
  // How long one call waits for a server that is away (restarted, failing over) before it says Unavailable.
  absl::Duration retry_deadline = absl::Seconds(30);
};

// The store of a cluster: a database of PostgreSQL 12 or newer, which several coordinators share (docs/adr/0008).
// `url` is a connection string of libpq, postgresql://USER@HOST:PORT/DATABASE. Opening creates the tables, or brings
// them up to date. A call whose connection breaks is repeated over a new one, so it may have taken effect before: what
// CreateReconstruction calls AlreadyExists may be its own, and a lease that was granted to nobody runs out.
absl::StatusOr<std::unique_ptr<JobStore>> OpenPostgresJobStore(const std::string& url,
                                                               const PostgresOptions& options = {},
                                                               const WrapSqlDatabase& wrap = nullptr);

}  // namespace meshwright
