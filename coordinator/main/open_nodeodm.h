// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include <absl/status/statusor.h>

#include "common/base/clock.h"
#include "common/blob/blob_store.h"
#include "common/telemetry/log.h"
#include "coordinator/api/reconstruction_service.h"
#include "coordinator/auth/gatekeeper.h"
#include "coordinator/dispatch/worker_service.h"
#include "coordinator/main/coordinator_program.h"
#include "coordinator/nodeodm/nodeodm_server.h"

namespace meshwright {

// NodeODM's protocol as the settings ask for it; null when they ask for none. What is passed outlives it.
absl::StatusOr<std::unique_ptr<NodeOdmServer>> OpenNodeOdm(const CoordinatorSettings& settings,
                                                           ReconstructionService& reconstructions,
                                                           WorkerService& workers, BlobStore& blobs, Gatekeeper& gate,
                                                           const Clock& clock, const Logger& log);

}  // namespace meshwright
