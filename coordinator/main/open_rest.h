// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include <absl/status/statusor.h>

#include "common/blob/blob_store.h"
#include "common/telemetry/log.h"
#include "coordinator/api/reconstruction_service.h"
#include "coordinator/auth/gatekeeper.h"
#include "coordinator/dispatch/worker_service.h"
#include "coordinator/main/coordinator_program.h"
#include "coordinator/rest/rest_server.h"
#include "coordinator/store/job_store.h"

namespace meshwright {

// The REST interface as the settings ask for it; null when they ask for none. NotFound or InvalidArgument names the
// setting. `log` outlives it.
absl::StatusOr<std::unique_ptr<RestServer>> OpenRest(const CoordinatorSettings& settings,
                                                     ReconstructionService& reconstructions, WorkerService& workers,
                                                     BlobStore& blobs, JobStore& store, Gatekeeper& gate,
                                                     ThreadPool& pool, const Logger& log);

}  // namespace meshwright
