// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>

#include "common/blob/blob_store.h"
#include "worker/agent/worker_channel.h"

namespace meshwright {

struct CoordinatorCredentials {
  std::string key;              // "": none is shown
  std::string ca_certificates;  // PEM, of those who may vouch for the coordinator; "": no TLS
  std::string certificate;      // PEM, the worker's own and those above it; "": none is shown
  std::string private_key;      // PEM
};

// A coordinator at "host:port", as a WorkerChannel, and as a BlobStore for workers that reach no other: Put and Get
// stream through it; Has and Delete are Unimplemented, workers need neither. Thread-safe. Connects when it is used
// first, and again whenever the connection breaks.
class GrpcCoordinator : public WorkerChannel, public BlobStore {
 public:
  static std::unique_ptr<GrpcCoordinator> Connect(const std::string& address,
                                                  const CoordinatorCredentials& credentials = {});
};

}  // namespace meshwright
