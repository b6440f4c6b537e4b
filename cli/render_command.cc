#include <map>
#include <memory>

#include <absl/strings/str_cat.h>

#include "tools/rendering/mesh_renderer.h"

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

absl::Status RenderMesh(const Arguments& arguments) {
  ThreadPool pool(arguments.threads);
  MW_ASSIGN_OR_RETURN(const Scene scene, LoadScene(arguments.scene));
  MW_ASSIGN_OR_RETURN(Camera camera, FindCamera(scene, arguments));
  const absl::StatusOr<TriangleMesh> mesh = ReadPly(arguments.mesh);
  if (!mesh.ok()) return BadInput(mesh.status());
  const MeshRenderer renderer(*mesh);
  if (arguments.orbit_deg != 0 || arguments.pitch_deg != 0) {
    camera = OrbitCamera(camera, renderer.Pivot(camera, pool), arguments.orbit_deg * kRadiansPerDegree,
                         arguments.pitch_deg * kRadiansPerDegree);
  }
  return WritePng(arguments.picture, renderer.Render(camera, {.shading = arguments.shading}, pool));
}

int RunCommand(const Arguments& arguments) {
  const absl::Status status = RenderMesh(arguments);
  return status.ok() ? kExitDone : Fail(status);
}

}  // namespace

void AddRenderCommand(CLI::App& program, Run& run) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App& command = *program.add_subcommand("render", "Make a picture of a mesh as one of the cameras sees it");
  command.footer(kExamples);
  command.add_option("MESH", arguments->mesh, "mesh or point cloud, PLY")->required();
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
  AddThreadsOption(command, arguments->threads);
  command.callback([arguments, &run] { run = [arguments] { return RunCommand(*arguments); }; });
}

}  // namespace meshwright
