// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>
#include <set>
#include <string>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "common/blob/blob_store.h"
#include "common/mesh/formats/mesh_format.h"
#include "common/scene/scene.h"
#include "coordinator/api/reconstruction_service.h"
#include "coordinator/auth/gatekeeper.h"
#include "coordinator/dispatch/worker_service.h"

namespace meshwright {

struct RestOptions {
  std::string listen;                     // "host:port"; port 0 takes a free one
  std::string folder;                     // uploads that are not complete, converted meshes
  std::string page_folder;                // the dashboard's files; "": none
  std::string tls_certificate_file;       // PEM, read again when it changes; "": no TLS
  std::string tls_key_file;               // PEM
  std::set<std::string> trusted_proxies;  // addresses whose X-Forwarded-For is believed
  int max_event_streams = 2500;
  int max_event_streams_per_caller = 250;
  int idle_timeout_seconds = 10;  // clients that neither send nor take anything for so long are dropped
  // Told in one line what no caller hears.
  std::function<void(const std::string&)> warn = [](const std::string&) {};
};

// Gives a mesh a texture cut from the scene's photographs, whose image_path are files, and writes it in the format.
struct TextureRequest {
  std::string ply_path;
  const Scene* scene = nullptr;
  std::string options_json;  // of the reconstruction
  const MeshFormat* format = nullptr;
  std::string path;
};
using WriteTextured = std::function<absl::Status(const TextureRequest& request)>;

// Writes the report of a reconstruction that is done as one HTML page.
struct ReportRequest {
  const v1::Reconstruction* reconstruction = nullptr;
  std::string ply_path;
  const Scene* scene = nullptr;  // image_path of each view is a file
  std::string path;
};
using WriteReport = std::function<absl::Status(const ReportRequest& request)>;

// What the server is a shell over. All of it outlives the server.
struct RestServices {
  ReconstructionService* reconstructions = nullptr;
  WorkerService* workers = nullptr;
  BlobStore* blobs = nullptr;
  Gatekeeper* gate = nullptr;
  std::function<absl::Status()> ready;  // whether store and blobs can be reached
  std::string options_json;             // the answer of GET /v1/options
  WriteTextured write_textured;
  WriteReport write_report;
};

// The public interface over HTTP, as openapi.yaml says, and the dashboard's files: a thin shell over the service.
class RestServer {
 public:
  // InvalidArgument, or Unavailable when the port is taken.
  static absl::StatusOr<std::unique_ptr<RestServer>> Start(const RestOptions& options, const RestServices& services);
  virtual ~RestServer() = default;
  virtual int port() const = 0;
  // Ends event streams and downloads, answers what waits, takes nothing new.
  virtual void Shutdown() = 0;
};

}  // namespace meshwright
