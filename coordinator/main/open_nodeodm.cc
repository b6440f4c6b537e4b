// SPDX-License-Identifier: Apache-2.0
#include "coordinator/main/open_nodeodm.h"

#include <utility>

#include "pipeline/options/options_json.h"
#include "pipeline/texturing/texture_mesh.h"

#include "common/base/status_macros.h"
#include "common/base/thread_pool.h"
#include "common/mesh/formats/mesh_format.h"
#include "common/mesh/ply.h"

namespace meshwright {
namespace {

absl::Status WriteTextured(const Scene& scene, const std::string& options_json, const std::string& ply_path,
                           const std::string& glb_path, int threads) {
  MW_ASSIGN_OR_RETURN(const ReconstructionOptions options, ParseOptions(options_json));
  MW_ASSIGN_OR_RETURN(TriangleMesh mesh, ReadPly(ply_path));
  MW_ASSIGN_OR_RETURN(const MeshFormat* glb, MeshFormatByName("glb"));
  ThreadPool pool(threads);
  return WriteTexturedMesh(std::move(mesh), scene, {.max_image_size = options.max_image_size}, *glb, glb_path, pool)
      .status();
}

}  // namespace

absl::StatusOr<std::unique_ptr<NodeOdmServer>> OpenNodeOdm(const CoordinatorSettings& settings,
                                                           ReconstructionService& reconstructions,
                                                           WorkerService& workers, BlobStore& blobs, Gatekeeper& gate,
                                                           const Clock& clock, const Logger& log) {
  if (settings.nodeodm_listen.empty()) return nullptr;
  NodeOdmOptions options = {.listen = settings.nodeodm_listen,
                            .folder = settings.data_folder + "/nodeodm",
                            .tls_certificate_file = settings.rest_tls_certificate_file,
                            .tls_key_file = settings.rest_tls_key_file,
                            .max_images = settings.nodeodm_max_images};
  options.trusted_proxies = {settings.trusted_proxies.begin(), settings.trusted_proxies.end()};
  options.warn = [&log](const std::string& text) { log.Warning(text); };
  const NodeOdmServices services = {
      .reconstructions = &reconstructions,
      .workers = &workers,
      .blobs = &blobs,
      .gate = &gate,
      .clock = &clock,
      .options_json = DescribeOptionsForRest(),
      .write_textured_glb = [threads = settings.threads](const Scene& scene, const std::string& options_json,
                                                         const std::string& ply_path, const std::string& glb_path) {
        return WriteTextured(scene, options_json, ply_path, glb_path, threads);
      }};
  return NodeOdmServer::Start(options, services);
}

}  // namespace meshwright
