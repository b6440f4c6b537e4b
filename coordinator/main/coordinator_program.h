// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>
#include <vector>

#include <absl/status/statusor.h>
#include <absl/time/time.h>

namespace meshwright {

struct CoordinatorSettings {
  std::string listen = "127.0.0.1:7420";  // host:port; port 0 takes a free one
  std::string data_folder;                // state, uploads, meshes
  std::string store;                      // as for OpenJobStore; "": sqlite in the data folder
  std::string blobs;                      // as for OpenBlobStore; "": in the data folder
  std::vector<std::string> scene_roots;   // folders that scenes may be taken from by reference
  int threads = 1;                        // for acceptance and joining
  double lease_seconds = 30;
  double job_time_limit_seconds = 7200;
  std::string rest_listen;                   // host:port for HTTP; port 0 takes a free one; "": none
  std::string rest_tls_certificate_file;     // PEM; "": no TLS
  std::string rest_tls_key_file;             // PEM
  std::vector<std::string> trusted_proxies;  // addresses whose X-Forwarded-For is believed
  std::string page_folder;                   // the dashboard's files; "": where they are installed, if they are
  std::string nodeodm_listen;                // host:port for NodeODM's protocol; port 0 takes a free one; "": none
  int nodeodm_max_images = 0;                // of one of its tasks; 0: any number
  std::string webhook_url;                   // where ends of reconstructions are told; "": nowhere
  std::string webhook_secret_file;           // what that is signed with is in it
  std::string tls_certificate_file;          // PEM, for gRPC; "": no TLS
  std::string tls_key_file;                  // PEM
  std::string client_ca_file;                // PEM, who may vouch for workers; "": keys alone count
  bool grpc_reflection = false;
  std::string api_token_file;     // the operator's key is in it; "": nobody has to show one
  std::string worker_token_file;  // the key that workers join with; "": each has one of its own
  bool insecure = false;          // listen where others reach it without asking for keys
  int64_t user_reconstructions = 1000;
  int64_t user_gigabytes = 1000;  // uploaded
  double user_requests_per_second = 200;
  std::string metrics_listen;  // host:port for /metrics, /healthz and /readyz; port 0 takes a free one; "": none
};

// A coordinator as meshwright-coordinator and "meshwright up" run it.
class CoordinatorProgram {
 public:
  // Whether the settings make sense, as far as that can be said without opening, making or contacting anything.
  // InvalidArgument names the setting as a flag, its value and what was expected.
  static absl::Status Check(const CoordinatorSettings& settings);
  static absl::StatusOr<std::unique_ptr<CoordinatorProgram>> Start(const CoordinatorSettings& settings);
  virtual ~CoordinatorProgram() = default;
  virtual int port() const = 0;
  virtual int rest_port() const = 0;     // 0: none
  virtual int nodeodm_port() const = 0;  // 0: none
  virtual int metrics_port() const = 0;  // 0: none
  // Ends calls after `deadline` at the latest. State is safe whenever the process ends.
  virtual void Shutdown(absl::Duration deadline) = 0;
};

}  // namespace meshwright
