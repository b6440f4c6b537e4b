// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include <grpcpp/support/server_interceptor.h>

#include "common/telemetry/metrics.h"

namespace meshwright {

// Makes a gRPC server tell meshwright_rpc_seconds{operation} and meshwright_rpc_errors_total{operation, code} of the
// calls that it answers; operation is the method's name. Synchronize and the streams take as long as they wait for
// news, so their times say little. `metrics` outlives the server.
std::unique_ptr<grpc::experimental::ServerInterceptorFactoryInterface> MakeRpcMetrics(Metrics& metrics);

}  // namespace meshwright
