// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>

#include <absl/status/statusor.h>

namespace meshwright {

struct WorkerSettings {
  std::string coordinator = "127.0.0.1:7420";  // host:port
  std::string id;                              // "": host name and process
  std::string blobs;                           // the coordinator's, as for OpenBlobStore; "": through the coordinator
  std::string token_file;                      // with the key to join with; "": none is shown
  std::string ca_file;                         // PEM, of those who may vouch for the coordinator; "": no TLS
  std::string client_certificate_file;         // PEM, with the worker's name; "": none is shown
  std::string client_key_file;                 // PEM
  int cores = 1;
  int64_t memory_mib = 0;  // 0: 512 for each core, at least 1024
  double drain_seconds = 30;
  double exit_when_idle_seconds = 0;  // a worker that held nothing for so long ends; 0: it waits for more
  bool ran_out_of_memory = false;     // the process of this worker before this one was killed since memory ran out
  std::string metrics_listen;         // host:port for /metrics, /healthz and /readyz; port 0 takes a free one; "": none
};

// Host name and process.
std::string DefaultWorkerId();

// A worker as meshwright-worker and "meshwright up" run it.
class WorkerProgram {
 public:
  // Whether the settings make sense, as far as that can be said without contacting anybody. InvalidArgument names the
  // setting as a flag, its value and what was expected.
  static absl::Status Check(const WorkerSettings& settings);
  static absl::StatusOr<std::unique_ptr<WorkerProgram>> Make(const WorkerSettings& settings);
  virtual ~WorkerProgram() = default;
  // Until Drain(), or exit_when_idle_seconds, and what follows from it.
  virtual void Run() = 0;
  virtual void Drain() = 0;
  virtual int metrics_port() const = 0;  // 0: none
};

}  // namespace meshwright
