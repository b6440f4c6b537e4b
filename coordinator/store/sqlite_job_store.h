// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>

#include <absl/status/statusor.h>

#include "common/base/clock.h"
#include "coordinator/store/job_store.h"
#include "coordinator/store/sql_database.h"

namespace meshwright {

// The embedded default: one file, no server (docs/adr/0002). Opening creates the file, or brings its schema up to date.
// `clock` is what the store's Now() reads (none: the machine's clock) and outlives the store.
absl::StatusOr<std::unique_ptr<JobStore>> OpenSqliteJobStore(const std::string& path, const Clock* clock = nullptr,
                                                             const WrapSqlDatabase& wrap = nullptr);

}  // namespace meshwright
