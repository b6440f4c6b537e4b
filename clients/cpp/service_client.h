// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>
#include <string>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "meshwright/v1/access.pb.h"
#include "meshwright/v1/reconstruction.pb.h"

namespace meshwright {

struct ServiceCredentials {
  std::string key;              // "": none is shown
  std::string ca_certificates;  // PEM, of those who may vouch for the coordinator; "": no TLS
};

// ReconstructionService and AccessService of the coordinator at "host:port". Errors are the coordinator's; Unavailable
// when it cannot be reached.
class ServiceClient {
 public:
  static std::unique_ptr<ServiceClient> Connect(const std::string& address, const ServiceCredentials& credentials = {});
  virtual ~ServiceClient() = default;

  virtual absl::StatusOr<v1::Reconstruction> Create(const v1::CreateReconstructionRequest& request) = 0;
  // The file `local_path` becomes `path` of the scene.
  virtual absl::Status Upload(const std::string& id, const std::string& path, const std::string& local_path) = 0;
  virtual absl::StatusOr<v1::ListSceneFilesResponse> ListSceneFiles(const std::string& id) = 0;
  virtual absl::StatusOr<v1::Reconstruction> Start(const std::string& id) = 0;
  virtual absl::StatusOr<v1::Reconstruction> Get(const std::string& id) = 0;
  virtual absl::StatusOr<v1::ListReconstructionsResponse> List(const std::string& page_token) = 0;
  // Until it is over.
  virtual absl::Status Watch(const std::string& id, const std::function<void(const v1::Reconstruction&)>& changed) = 0;
  virtual absl::StatusOr<v1::Reconstruction> Cancel(const std::string& id) = 0;
  virtual absl::Status Delete(const std::string& id) = 0;
  // Writes the mesh to `path`, whole and with the right digest or not at all.
  virtual absl::Status Fetch(const std::string& id, const std::string& path) = 0;
  // The surfaces accepted so far.
  virtual absl::StatusOr<v1::ListPartsResponse> ListParts(const std::string& id) = 0;
  // One of them, encoded (docs/formats/surface.md), with the digest that `part` names.
  virtual absl::StatusOr<std::string> DownloadPart(const std::string& id, const v1::Part& part) = 0;
  virtual absl::StatusOr<v1::ListWorkersResponse> ListWorkers() = 0;
  virtual absl::StatusOr<v1::CreateKeyResponse> CreateKey(const v1::CreateKeyRequest& request) = 0;
  virtual absl::StatusOr<v1::ListKeysResponse> ListKeys() = 0;
  virtual absl::Status RevokeKey(const std::string& id) = 0;
};

}  // namespace meshwright
