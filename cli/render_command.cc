// SPDX-License-Identifier: Apache-2.0
#include <cstdio>
#include <map>
#include <memory>
#include <optional>

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>

#include "tools/rendering/mesh_renderer.h"
#include "tools/rendering/picture_comparison.h"
#include "tools/rendering/textured_model.h"

#include "cli/commands.h"
#include "common/base/bad_input.h"
#include "common/base/status_macros.h"
#include "common/base/thread_pool.h"
#include "common/image/encode.h"
#include "common/mesh/ply.h"
#include "common/scene/view.h"

namespace meshwright {
namespace {

constexpr double kRadiansPerDegree = 3.14159265358979323846 / 180;

constexpr char kExamples[] = R"(Examples:
  meshwright render mesh.ply --scene scene --camera 0003.png -o front.png
  meshwright render mesh.ply --scene scene --camera 0003.png --orbit-deg 40 --shading normals -o aside.png)";

struct Arguments {
  std::string mesh;
  SceneArguments scene;
  std::string camera;
  double orbit_deg = 0;
  double pitch_deg = 0;
  int max_image_size = 1024;
  Shading shading = Shading::kColors;
  std::string picture;
  bool compare = false;
  std::string ground_truth;
  int threads = AvailableCores();
};

absl::StatusOr<Camera> FindCamera(const Scene& scene, const Arguments& arguments) {
  for (const SceneView& view : scene.views) {
    if (view.name == arguments.camera) return UndistortedCamera(view, arguments.max_image_size);
  }
  return BadInput(
      absl::NotFoundError(absl::StrCat(arguments.scene.path, ": no camera \"", arguments.camera, "\"; the first of ",
                                       scene.views.size(), " is \"", scene.views.front().name, "\"")));
}

// What is drawn: a mesh or point cloud with colours at its vertices, or a model with a texture atlas.
class Drawing {
 public:
  // In the frame of a scene with this offset.
  static absl::StatusOr<std::unique_ptr<Drawing>> Read(const std::string& path, const Eigen::Vector3d& offset) {
    auto drawing = std::make_unique<Drawing>();
    if (absl::EndsWithIgnoreCase(path, ".glb")) {
      MW_ASSIGN_OR_RETURN(drawing->model_, ReadTexturedGlb(path));
      ChangeOffset(offset, drawing->model_.mesh);
      drawing->textured_.emplace(drawing->model_);
    } else {
      MW_ASSIGN_OR_RETURN(drawing->model_.mesh, ReadPly(path));
      ChangeOffset(offset, drawing->model_.mesh);
    }
    drawing->colored_.emplace(drawing->model_.mesh);
    return drawing;
  }

  ColorImage Render(const Camera& camera, Shading shading, ThreadPool& pool) const {
    const RenderOptions options = {.shading = shading};
    if (textured_.has_value() && shading == Shading::kColors) {
      return textured_->Render(camera, options.background, pool);
    }
    return colored_->Render(camera, options, pool);
  }

  const MeshRenderer& colored() const { return *colored_; }
  const TexturedModel* textured() const { return textured_.has_value() ? &model_ : nullptr; }

 private:
  TexturedModel model_;
  std::optional<MeshRenderer> colored_;
  std::optional<TexturedModelRenderer> textured_;
};

absl::Status Compare(const Arguments& arguments, const Scene& scene, const Drawing& drawing, const Camera& camera,
                     const ColorImage& picture, ThreadPool& pool) {
  for (const SceneView& view : scene.views) {
    if (view.name != arguments.camera) continue;
    MW_ASSIGN_OR_RETURN(const View photograph, LoadView(view, arguments.max_image_size));
    std::optional<MeshRayCaster> truth;
    if (!arguments.ground_truth.empty()) {
      const absl::StatusOr<TriangleMesh> mesh = ReadPly(arguments.ground_truth);
      if (!mesh.ok()) return BadInput(mesh.status());
      truth.emplace(*mesh);
    }
    const PictureComparison comparison = CompareWhereCovered(picture, photograph.color, drawing.colored().caster(),
                                                             camera, pool, truth.has_value() ? &*truth : nullptr);
    std::printf("%.2f dB PSNR over the %.1f%% of the photograph that are %s\n", comparison.psnr_db,
                100 * comparison.share, truth.has_value() ? "covered by right depths" : "covered");
    if (drawing.textured() != nullptr) {
      const EdgeJumps jumps = MeasureEdgeJumps(*drawing.textured());
      std::printf("%.2f grey levels across %s edges between pieces of photographs, %.2f across others\n",
                  jumps.at_seams, FormatCount(jumps.seams).c_str(), jumps.within_charts);
    }
  }
  return absl::OkStatus();
}

absl::Status RenderMesh(const Arguments& arguments) {
  ThreadPool pool(arguments.threads);
  MW_ASSIGN_OR_RETURN(const Scene scene, LoadScene(arguments.scene));
  MW_ASSIGN_OR_RETURN(Camera camera, FindCamera(scene, arguments));
  const absl::StatusOr<std::unique_ptr<Drawing>> drawing = Drawing::Read(arguments.mesh, scene.offset);
  if (!drawing.ok()) return BadInput(drawing.status());
  if (arguments.orbit_deg != 0 || arguments.pitch_deg != 0) {
    camera = OrbitCamera(camera, (*drawing)->colored().Pivot(camera, pool), arguments.orbit_deg * kRadiansPerDegree,
                         arguments.pitch_deg * kRadiansPerDegree);
  }
  const ColorImage picture = (*drawing)->Render(camera, arguments.shading, pool);
  if (arguments.compare) MW_RETURN_IF_ERROR(Compare(arguments, scene, **drawing, camera, picture, pool));
  return WritePng(arguments.picture, picture);
}

int RunCommand(const Arguments& arguments) {
  if (arguments.compare && (arguments.orbit_deg != 0 || arguments.pitch_deg != 0)) {
    return FailWrongUse(
        "--compare is given, expected no --orbit-deg and no --pitch-deg: there is no photograph from there");
  }
  if (!arguments.ground_truth.empty() && !arguments.compare) {
    return FailWrongUse("--ground-truth is given, expected --compare with it: it says where to compare");
  }
  const absl::Status status = RenderMesh(arguments);
  return status.ok() ? kExitDone : Fail(status);
}

}  // namespace

void AddRenderCommand(CLI::App& program, Run& run) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App& command = *program.add_subcommand("render", "Make a picture of a mesh as one of the cameras sees it");
  command.footer(kExamples);
  command.add_option("MESH", arguments->mesh, "mesh or point cloud, PLY; or a model with a texture, GLB")->required();
  command.add_option("--scene", arguments->scene.path, "folder with the cameras")->required();
  AddSceneOptions(command, arguments->scene);
  command.add_option("--camera", arguments->camera, "name of the photograph whose camera looks")->required();
  command.add_option("-o,--output", arguments->picture, "the picture to write, PNG")->required();
  command.add_option("--orbit-deg", arguments->orbit_deg, "move the camera around what it sees, to its right, degrees")
      ->capture_default_str();
  command.add_option("--pitch-deg", arguments->pitch_deg, "and upwards, degrees")->capture_default_str();
  command.add_option("--max-image-size", arguments->max_image_size, "longest side of the picture, px")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  command.add_option("--shading", arguments->shading, "colors, normals (red from behind) or cameras")
      ->transform(CLI::CheckedTransformer(
          std::map<std::string, Shading>{
              {"colors", Shading::kColors}, {"normals", Shading::kNormals}, {"cameras", Shading::kCameras}},
          CLI::ignore_case))
      ->type_name("SHADING")
      ->default_str("colors");
  command.add_flag("--compare", arguments->compare, "print how far the picture is from the photograph");
  command.add_option("--ground-truth", arguments->ground_truth,
                     "compare only where the surface is within 4 footprints of this one, PLY: colours, not holes");
  AddThreadsOption(command, arguments->threads);
  command.callback([arguments, &run] { run = [arguments] { return RunCommand(*arguments); }; });
}

}  // namespace meshwright
