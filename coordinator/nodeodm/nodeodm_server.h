// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>
#include <set>
#include <string>

#include <absl/status/statusor.h>

#include "common/base/clock.h"
#include "common/blob/blob_store.h"
#include "coordinator/api/reconstruction_service.h"
#include "coordinator/auth/gatekeeper.h"
#include "coordinator/dispatch/worker_service.h"
#include "coordinator/nodeodm/result_package.h"

namespace meshwright {

struct NodeOdmOptions {
  std::string listen;                     // "host:port"; port 0 takes a free one
  std::string folder;                     // tasks and their results
  std::string tls_certificate_file;       // PEM; "": no TLS
  std::string tls_key_file;               // PEM
  std::set<std::string> trusted_proxies;  // addresses whose X-Forwarded-For is believed
  int max_images = 0;                     // of a task; 0: any number
  std::function<void(const std::string&)> warn = [](const std::string&) {};
};

// What the server is a shell over. All of it outlives the server.
struct NodeOdmServices {
  ReconstructionService* reconstructions = nullptr;
  WorkerService* workers = nullptr;
  BlobStore* blobs = nullptr;
  Gatekeeper* gate = nullptr;
  const Clock* clock = nullptr;
  std::string options_json;  // the answer of GET /v1/options
  WriteTexturedGlb write_textured_glb;
};

// NodeODM's protocol (its version 2.2), so that WebODM, PyODM, CloudODM and ClusterODM find a node: docs/nodeodm.md.
class NodeOdmServer {
 public:
  // InvalidArgument, or Unavailable when the port is taken.
  static absl::StatusOr<std::unique_ptr<NodeOdmServer>> Start(const NodeOdmOptions& options,
                                                              const NodeOdmServices& services);
  virtual ~NodeOdmServer() = default;
  virtual int port() const = 0;
  // Ends downloads, answers what waits, takes nothing new.
  virtual void Shutdown() = 0;
};

}  // namespace meshwright
