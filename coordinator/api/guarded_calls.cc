// SPDX-License-Identifier: Apache-2.0
#include "coordinator/api/guarded_calls.h"

#include "common/base/status_macros.h"

namespace meshwright {

absl::StatusOr<v1::Reconstruction> CreateFor(const Caller& caller, Gatekeeper& gate, ReconstructionService& service,
                                             const v1::CreateReconstructionRequest& request) {
  // Repeating the call is harmless, also for who has as many as are allowed.
  if (absl::IsNotFound(service.Get(request.id()).status())) MW_RETURN_IF_ERROR(gate.CheckReconstructions(caller));
  return service.Create(request, caller.user);
}

absl::StatusOr<v1::Reconstruction> CreateAgainFor(const Caller& caller, Gatekeeper& gate,
                                                  ReconstructionService& service, const std::string& source,
                                                  const v1::CreateReconstructionRequest& request) {
  if (absl::IsNotFound(service.Get(request.id()).status())) MW_RETURN_IF_ERROR(gate.CheckReconstructions(caller));
  return service.CreateAgain(source, request, caller.user);
}

absl::StatusOr<v1::ListReconstructionsResponse> ListFor(const Caller& caller, const ReconstructionService& service,
                                                        const v1::ListReconstructionsRequest& request) {
  if (caller.role == Role::kOperator) return service.List(request);
  return service.List(request, caller.user);
}

}  // namespace meshwright
