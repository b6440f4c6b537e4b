// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <absl/status/statusor.h>

#include "meshwright/v1/reconstruction.pb.h"

#include "coordinator/api/reconstruction_service.h"
#include "coordinator/auth/gatekeeper.h"

namespace meshwright {

// Calls whose outcome depends on who makes them, for all interfaces alike. The caller may make them: Gatekeeper::Check.

// The caller's own, if that is within the quota of reconstructions.
absl::StatusOr<v1::Reconstruction> CreateFor(const Caller& caller, Gatekeeper& gate, ReconstructionService& service,
                                             const v1::CreateReconstructionRequest& request);
// The same of the scene of `source`, which the caller may change.
absl::StatusOr<v1::Reconstruction> CreateAgainFor(const Caller& caller, Gatekeeper& gate,
                                                  ReconstructionService& service, const std::string& source,
                                                  const v1::CreateReconstructionRequest& request);
// Those that the caller may see.
absl::StatusOr<v1::ListReconstructionsResponse> ListFor(const Caller& caller, const ReconstructionService& service,
                                                        const v1::ListReconstructionsRequest& request);

}  // namespace meshwright
