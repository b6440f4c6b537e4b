// SPDX-License-Identifier: Apache-2.0
#include "coordinator/main/open_rest.h"

#include <filesystem>
#include <string>
#include <utility>

#include <absl/strings/str_cat.h>
#include <absl/time/time.h>
#include <nlohmann/json.hpp>

#include "pipeline/config/parse_config.h"
#include "pipeline/options/options_json.h"
#include "pipeline/report/cameras_report.h"
#include "pipeline/report/report_page.h"
#include "pipeline/texturing/texture_mesh.h"

#include "common/base/files.h"
#include "common/base/status_macros.h"
#include "common/base/version.h"
#include "common/json/parse_json.h"
#include "common/mesh/ply.h"

namespace meshwright {
namespace {

namespace fs = std::filesystem;

// Beside the program as it is installed, or in the tree that it was built in. "": nowhere.
std::string FindPage() {
  std::error_code error;
  const fs::path program = fs::read_symlink("/proc/self/exe", error);
  for (const char* place : {"../share/meshwright/dashboard", "../../../dashboard/dist"}) {
    const fs::path folder = program.parent_path() / place;
    if (fs::exists(folder / "index.html", error)) return folder.lexically_normal();
  }
  return "";
}

absl::Status Write(const TextureRequest& request, ThreadPool& pool) {
  MW_ASSIGN_OR_RETURN(const ReconstructionConfig config, ParseConfig(request.options_json));
  MW_ASSIGN_OR_RETURN(TriangleMesh mesh, ReadPly(request.ply_path));
  TextureOptions options;
  options.max_image_size = config.max_image_size;
  return WriteTexturedMesh(std::move(mesh), *request.scene, options, *request.format, request.path, pool).status();
}

absl::Duration SecondsBetween(const google::protobuf::Timestamp& begin, const google::protobuf::Timestamp& end) {
  return absl::Seconds(end.seconds() - begin.seconds()) + absl::Nanoseconds(end.nanos() - begin.nanos());
}

// As report.json of a reconstruction in one process has it, less what only that process knows.
absl::StatusOr<nlohmann::ordered_json> MakeReport(const v1::Reconstruction& reconstruction, const Scene& scene,
                                                  JobStore& store) {
  ReportTotals totals;
  MW_ASSIGN_OR_RETURN(nlohmann::ordered_json report, MakeCamerasReport(scene, store, reconstruction.id(), &totals));
  report["program"] = absl::StrCat("meshwright ", kProgramVersion);
  report["mesh"] = {{"vertices", reconstruction.progress().vertices()}, {"faces", reconstruction.progress().faces()}};
  report["scene"] = {{"format", scene.format}, {"photographs", scene.views.size()}};
  const absl::Duration took = SecondsBetween(reconstruction.create_time(), reconstruction.finish_time());
  report["process"] = {{"wall_seconds", absl::ToDoubleSeconds(took)}};
  MW_ASSIGN_OR_RETURN(const Reconstruction stored, store.GetReconstruction(reconstruction.id()));
  if (!stored.mesh.verdict_json.empty()) {
    MW_ASSIGN_OR_RETURN(report["verdict"], ParseJson<nlohmann::ordered_json>(stored.mesh.verdict_json));
  }
  MW_ASSIGN_OR_RETURN(report["options"], ParseJson<nlohmann::ordered_json>(reconstruction.options_json()));
  return report;
}

absl::Status WritePage(const ReportRequest& request, JobStore& store, ThreadPool& pool) {
  MW_ASSIGN_OR_RETURN(const nlohmann::ordered_json report, MakeReport(*request.reconstruction, *request.scene, store));
  const ReportPageInput input = {
      .title = request.reconstruction->id(), .report = report, .scene = *request.scene, .ply_path = request.ply_path};
  MW_ASSIGN_OR_RETURN(const std::string page, MakeReportPage(input, pool));
  return WriteFileAtomically(request.path, page);
}

}  // namespace

absl::StatusOr<std::unique_ptr<RestServer>> OpenRest(const CoordinatorSettings& settings,
                                                     ReconstructionService& reconstructions, WorkerService& workers,
                                                     BlobStore& blobs, JobStore& store, Gatekeeper& gate,
                                                     ThreadPool& pool, const Logger& log) {
  if (settings.rest_listen.empty()) return nullptr;
  RestOptions options = {.listen = settings.rest_listen,
                         .folder = settings.data_folder + "/rest",
                         .page_folder = settings.page_folder.empty() ? FindPage() : settings.page_folder};
  options.tls_certificate_file = settings.rest_tls_certificate_file;
  options.tls_key_file = settings.rest_tls_key_file;
  options.trusted_proxies = {settings.trusted_proxies.begin(), settings.trusted_proxies.end()};
  options.warn = [&log](const std::string& text) { log.Warning(text); };
  RestServices services = {
      .reconstructions = &reconstructions,
      .workers = &workers,
      .blobs = &blobs,
      .gate = &gate,
      .options_json = DescribeOptionsForRest(),
      .write_textured = [&pool](const TextureRequest& request) { return Write(request, pool); },
      .write_report = [&store, &pool](const ReportRequest& request) { return WritePage(request, store, pool); }};
  services.ready = [&blobs, &store]() -> absl::Status {
    MW_RETURN_IF_ERROR(store.Now().status());
    // No blob has this digest; who says so can be reached.
    const absl::Status found = blobs.Get(std::string(64, '0')).status();
    return absl::IsNotFound(found) ? absl::OkStatus() : found;
  };
  return RestServer::Start(options, services);
}

}  // namespace meshwright
