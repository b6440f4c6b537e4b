// SPDX-License-Identifier: Apache-2.0
#include "cli/commands.h"

#include <algorithm>
#include <thread>
#include <vector>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>

#include "pipeline/cameras/photograph_folder.h"

#include "common/base/bad_input.h"
#include "common/base/files.h"
#include "common/base/status_macros.h"
#include "common/job/camera_refinement.h"
#include "common/scene/formats/formats.h"
#include "common/scene/formats/import.h"

namespace meshwright {

namespace {

absl::Status ApplyRefinementFrom(const std::string& path, Scene& scene) {
  MW_ASSIGN_OR_RETURN(const std::string text, ReadFile(path));
  MW_ASSIGN_OR_RETURN(const CameraRefinement refinement, DecodeCameraRefinement(text));
  return ApplyRefinement(refinement, scene);
}

}  // namespace

void AddSceneOptions(CLI::App& command, SceneArguments& scene) {
  std::vector<std::string> names;
  for (const SceneFormat& format : SceneFormats()) names.emplace_back(format.name);
  command
      .add_option("--format", scene.import.format,
                  absl::StrCat("read the scene as ", absl::StrJoin(names, ", "), "; without it the content tells"))
      ->check(CLI::IsMember(names))
      ->type_name("FORMAT");
  command
      .add_option("--model", scene.import.model,
                  "which of several reconstructions in the scene (sparse/N); without it the one with most photographs")
      ->check(CLI::NonNegativeNumber);
  command.add_option("--images", scene.import.images_folder, "where the photographs are, if not in the scene's folder")
      ->type_name("FOLDER");
  command
      .add_option("--masks", scene.import.masks_folder,
                  "where masks of photographs are, black where nothing is to be looked at; without it masks/ beside "
                  "images/, and NAME_mask.png")
      ->type_name("FOLDER");
  command
      .add_option("--region", scene.import.region,
                  "a box (JSON) outside of which nothing is reconstructed; \"auto\": around the sparse points; "
                  "\"none\"; without it region.json of the scene")
      ->type_name("FILE|auto|none");
  command
      .add_option("--refined-cameras", scene.refined_cameras,
                  "the cameras that reconstruct refined (MESH.cameras.json), in the place of the scene's")
      ->type_name("FILE");
  command.add_flag("--rescale-cameras", scene.import.rescale_cameras,
                   "cameras follow photographs that are larger or smaller than they say, by a common factor");
  command
      .add_option_function<std::vector<double>>(
          "--intrinsics",
          [&scene](const std::vector<double>& k) {
            scene.import.intrinsics = {k[0], k[1], k[2], k[3]};
          },
          "of all photographs, px; for formats that have poses alone")
      ->delimiter(',')
      ->expected(4)
      ->type_name("FX,FY,CX,CY");
}

void AddOutputOptions(CLI::App& command, OutputSettings& output) {
  command.add_flag("--json", output.json, "print the result as JSON on stdout");
  command.add_flag("-q,--quiet", output.quiet, "no progress");
}

void AddThreadsOption(CLI::App& command, int& threads) {
  command.add_option("--threads", threads, "cores to use; no influence on the result")
      ->check(CLI::Range(1, 1024))
      ->capture_default_str();
}

int AvailableCores() { return std::max(1, static_cast<int>(std::thread::hardware_concurrency())); }

bool LacksCameras(const SceneArguments& arguments) {
  return !arguments.import.format.has_value() && !HoldsScene(arguments.path) && HoldsPhotographs(arguments.path);
}

absl::StatusOr<Scene> LoadScene(const SceneArguments& arguments) {
  if (LacksCameras(arguments)) {
    return BadInput(
        absl::InvalidArgumentError(absl::StrCat(arguments.path, ": photographs without cameras; meshwright cameras ",
                                                arguments.path, " -o SCENE makes a scene")));
  }
  absl::StatusOr<Scene> scene = ImportScene(arguments.path, arguments.import);
  if (!scene.ok()) return BadInput(scene.status());
  for (const std::string& warning : scene->warnings) Warn(warning);
  if (!arguments.refined_cameras.empty()) {
    if (const absl::Status refined = ApplyRefinementFrom(arguments.refined_cameras, *scene); !refined.ok()) {
      return BadInput(absl::Status(refined.code(), absl::StrCat(arguments.refined_cameras, ": ", refined.message())));
    }
  }
  return scene;
}

}  // namespace meshwright
