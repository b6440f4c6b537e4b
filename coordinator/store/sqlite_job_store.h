#pragma once

#include <memory>
#include <string>

#include <absl/status/statusor.h>

#include "coordinator/store/job_store.h"

namespace meshwright {

// The embedded default: one file, no server (docs/adr/0002). Opening creates the file, or brings its schema up to date.
absl::StatusOr<std::unique_ptr<JobStore>> OpenSqliteJobStore(const std::string& path);

}  // namespace meshwright
