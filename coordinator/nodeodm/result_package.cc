// SPDX-License-Identifier: Apache-2.0
#include "coordinator/nodeodm/result_package.h"

#include <algorithm>
#include <filesystem>
#include <system_error>

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>
#include <nlohmann/json.hpp>

#include "common/base/files.h"
#include "common/base/status_macros.h"
#include "common/base/version.h"
#include "common/json/json_text.h"
#include "common/json/parse_json.h"
#include "common/mesh/formats/mesh_format.h"
#include "coordinator/api/photograph_files.h"
#include "coordinator/nodeodm/odm_cameras.h"

namespace meshwright {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

// Names that WebODM looks for.
constexpr char kModel[] = "odm_texturing/odm_textured_model_geo.glb";
constexpr char kPoints[] = "odm_georeferencing/odm_georeferenced_model.las";
constexpr char kMesh[] = "odm_meshing/odm_mesh.ply";
constexpr char kShots[] = "odm_report/shots.geojson";
constexpr char kStatistics[] = "odm_report/stats.json";
constexpr char kCameras[] = "cameras.json";
constexpr char kImages[] = "images.json";
constexpr char kLog[] = "log.json";
constexpr char kOutput[] = "task_output.txt";
// In the order of the archive; small ones first, so that whoever looks has them at once.
constexpr const char* kAll[] = {kCameras, kImages, kLog, kOutput, kShots, kStatistics, kModel, kPoints, kMesh};

constexpr char kFiles[] = "files";
constexpr char kPhotographs[] = "photographs";
constexpr char kManifest[] = "manifest.json";

std::string Text(const Json& json) { return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n"; }

class Maker {
 public:
  Maker(const OdmTask& task, bool skips_model, const std::vector<std::string>& output,
        const ResultPackage::Sources& sources, const std::string& folder)
      : task_(task), skips_model_(skips_model), output_(output), sources_(sources), folder_(folder) {}

  absl::Status Make() {
    std::error_code error;
    fs::remove_all(folder_, error);
    MW_ASSIGN_OR_RETURN(reconstruction_, sources_.reconstructions->Get(ReconstructionOf(task_)));
    MW_ASSIGN_OR_RETURN(scene_, sources_.reconstructions->LoadScene(reconstruction_.id()));
    MW_ASSIGN_OR_RETURN(ply_path_, sources_.reconstructions->MeshPath(reconstruction_.id()));
    MW_RETURN_IF_ERROR(MakeSmallFiles());
    MW_RETURN_IF_ERROR(MakeMeshes());
    if (!skips_model_) MW_RETURN_IF_ERROR(MakeModel());
    return WriteManifest();
  }

 private:
  absl::StatusOr<std::string> PathOf(const std::string& name) const {
    const fs::path path = fs::path(folder_) / kFiles / name;
    std::error_code error;
    fs::create_directories(path.parent_path(), error);
    if (error) return absl::InternalError(absl::StrCat("the result cannot be written: ", error.message()));
    return path.string();
  }

  absl::Status Write(const std::string& name, const std::string& text) const {
    MW_ASSIGN_OR_RETURN(const std::string path, PathOf(name));
    return WriteFileAtomically(path, text);
  }

  absl::Status MakeSmallFiles() const {
    const v1::Progress& progress = reconstruction_.progress();
    MW_RETURN_IF_ERROR(Write(kCameras, Text(OdmCameras(scene_))));
    MW_RETURN_IF_ERROR(Write(kImages, Text(OdmImages(scene_))));
    MW_RETURN_IF_ERROR(Write(kShots, Text(OdmShots(scene_))));
    MW_RETURN_IF_ERROR(Write(kOutput, absl::StrJoin(output_, "\n") + "\n"));
    MW_RETURN_IF_ERROR(
        Write(kLog, Text({{"software", absl::StrCat("Meshwright ", kProgramVersion)},
                          {"options", Json::parse(reconstruction_.options_json(), nullptr, false)},
                          {"images", task_.images},
                          {"cameras", {{"total", progress.cameras_total()}, {"skipped", progress.cameras_skipped()}}},
                          {"mesh",
                           {{"vertices", progress.vertices()},
                            {"faces", progress.faces()},
                            {"sha256", reconstruction_.mesh_sha256()}}}})));
    return Write(kStatistics, Text({{"point_cloud_statistics", {{"dense", true}}},
                                    {"reconstruction_statistics",
                                     {{"reconstructed_points_count", progress.vertices()},
                                      {"reconstructed_shots_count", scene_.views.size()},
                                      {"initial_shots_count", task_.images},
                                      {"has_gps", false}}}}));
  }

  absl::Status MakeMeshes() const {
    MW_ASSIGN_OR_RETURN(const MeshFormat* las, MeshFormatByName("las"));
    MW_ASSIGN_OR_RETURN(const std::string points, PathOf(kPoints));
    MW_RETURN_IF_ERROR(ConvertPly(ply_path_, *las, /*points=*/true, points));
    MW_ASSIGN_OR_RETURN(const std::string mesh, PathOf(kMesh));
    std::error_code error;
    fs::create_hard_link(ply_path_, mesh, error);
    if (error) fs::copy_file(ply_path_, mesh, fs::copy_options::overwrite_existing, error);
    if (error) return absl::InternalError(absl::StrCat("the mesh cannot be copied: ", error.message()));
    return absl::OkStatus();
  }

  absl::Status MakeModel() {
    MW_ASSIGN_OR_RETURN(const std::string model, PathOf(kModel));
    const fs::path photographs = fs::path(folder_) / kPhotographs;
    MW_ASSIGN_OR_RETURN(const Scene scene, WithPhotographFiles(scene_, *sources_.blobs, photographs.string()));
    const absl::Status textured = sources_.write_textured_glb(scene, reconstruction_.options_json(), ply_path_, model);
    std::error_code error;
    fs::remove_all(photographs, error);
    if (!absl::IsFailedPrecondition(textured)) return textured;
    MW_ASSIGN_OR_RETURN(const MeshFormat* glb, MeshFormatByName("glb"));
    return ConvertPly(ply_path_, *glb, /*points=*/false, model);
  }

  // Reading the files once here is what lets downloads begin at once.
  absl::Status WriteManifest() const {
    Json manifest = Json::array();
    for (const char* name : kAll) {
      MW_ASSIGN_OR_RETURN(const std::string path, PathOf(name));
      std::error_code error;
      if (!fs::exists(path, error)) continue;
      MW_ASSIGN_OR_RETURN(const ZipEntry entry, MakeZipEntry(name, path));
      manifest.push_back({{"name", name}, {"size_bytes", entry.size_bytes}, {"crc32", entry.crc32}});
    }
    return WriteFileAtomically((fs::path(folder_) / kManifest).string(), JsonText(manifest));
  }

  const OdmTask& task_;
  const bool skips_model_;
  const std::vector<std::string>& output_;
  const ResultPackage::Sources& sources_;
  const std::string folder_;
  v1::Reconstruction reconstruction_;
  Scene scene_;
  std::string ply_path_;
};

bool IsWanted(const std::string& name, const std::vector<std::string>& outputs) {
  return outputs.empty() || std::any_of(outputs.begin(), outputs.end(), [&](const std::string& output) {
           return name == output || absl::StartsWith(name, output + "/");
         });
}

}  // namespace

absl::Status ResultPackage::Make(const OdmTask& task, bool skips_model, const std::vector<std::string>& output,
                                 const Sources& sources, const std::string& folder) {
  return Maker(task, skips_model, output, sources, folder).Make();
}

absl::StatusOr<std::vector<ZipEntry>> ResultPackage::Entries(const std::string& folder,
                                                             const std::vector<std::string>& outputs) {
  MW_ASSIGN_OR_RETURN(const std::string text, ReadFile((fs::path(folder) / kManifest).string()));
  MW_ASSIGN_OR_RETURN(const nlohmann::json manifest, ParseJson(text));
  std::vector<ZipEntry> entries;
  for (const nlohmann::json& item : manifest) {
    const std::string name = item.value("name", "");
    if (!IsWanted(name, outputs)) continue;
    entries.push_back({.name = name,
                       .path = (fs::path(folder) / kFiles / name).string(),
                       .size_bytes = item.value("size_bytes", int64_t{0}),
                       .crc32 = item.value("crc32", uint32_t{0})});
  }
  return entries;
}

}  // namespace meshwright
