// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>
#include <vector>

#include <absl/status/statusor.h>
#include <absl/time/time.h>
#include <grpcpp/support/server_interceptor.h>

#include "common/blob/blob_store.h"
#include "coordinator/api/reconstruction_service.h"
#include "coordinator/auth/gatekeeper.h"
#include "coordinator/dispatch/worker_service.h"

namespace meshwright {

struct GrpcServerOptions {
  std::string listen;                // "host:port"; port 0 takes a free one
  std::string tls_certificate_file;  // PEM, read again when it changes; "": no TLS
  std::string tls_key_file;          // PEM
  std::string client_ca_file;        // PEM, who may vouch for workers, read again when it changes; "": keys alone count
  bool reflection = false;           // tell everybody which calls there are
};

// ReconstructionService, WorkerService, AccessService, health and reflection on one port: a thin shell over the logic.
class GrpcServer {
 public:
  using Interceptors = std::vector<std::unique_ptr<grpc::experimental::ServerInterceptorFactoryInterface>>;

  // All of it outlives the server.
  static absl::StatusOr<std::unique_ptr<GrpcServer>> Start(const GrpcServerOptions& options,
                                                           ReconstructionService& reconstructions,
                                                           WorkerService& workers, BlobStore& blobs, Gatekeeper& gate,
                                                           Interceptors interceptors = {});
  virtual ~GrpcServer() = default;
  virtual int port() const = 0;
  // Answers what waits, then ends calls that last longer than `deadline`.
  virtual void Shutdown(absl::Duration deadline) = 0;
};

}  // namespace meshwright
