// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include <grpcpp/grpcpp.h>

#include "coordinator/auth/gatekeeper.h"

namespace meshwright {

// AccessService of access.proto. `gate` outlives it.
std::unique_ptr<grpc::Service> MakeAccessService(Gatekeeper& gate);

}  // namespace meshwright
