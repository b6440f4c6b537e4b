#include "tools/synthetic/synthetic_scene.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <Eigen/Geometry>
#include <absl/strings/str_format.h>

#include "tools/raycast/mesh_ray_caster.h"
#include "tools/synthetic/photographs.h"
#include "tools/synthetic/stage.h"

#include "common/base/status_macros.h"

namespace meshwright {
namespace {

absl::Status CheckRange(const char* field, double value, double low, double high) {
  if (value >= low && value <= high) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrFormat("SyntheticOptions.%s is %g, expected %g .. %g", field, value, low, high));
}

Lens LensOf(const Camera& camera) {
  Lens lens;
  lens.width = camera.width;
  lens.height = camera.height;
  lens.fx = camera.fx;
  lens.fy = camera.fy;
  lens.cx = camera.cx;
  lens.cy = camera.cy;
  return lens;
}

Stage BuildStage(const SyntheticOptions& options) {
  switch (options.kind) {
    case SyntheticKind::kRing:
      return BuildRing(options);
    case SyntheticKind::kStreet:
      return BuildStreet(options);
    case SyntheticKind::kFacade:
      break;
  }
  return BuildFacade(options);
}

}  // namespace

std::string SyntheticKindName(SyntheticKind kind) {
  switch (kind) {
    case SyntheticKind::kRing:
      return "ring";
    case SyntheticKind::kStreet:
      return "street";
    case SyntheticKind::kFacade:
      break;
  }
  return "facade";
}

absl::StatusOr<SyntheticKind> ParseSyntheticKind(const std::string& name) {
  for (const SyntheticKind kind : {SyntheticKind::kFacade, SyntheticKind::kRing, SyntheticKind::kStreet}) {
    if (name == SyntheticKindName(kind)) return kind;
  }
  return absl::InvalidArgumentError(
      absl::StrFormat("unknown kind of synthetic scene \"%s\", expected facade, ring or street", name));
}

absl::Status SyntheticOptions::Validate() const {
  MW_RETURN_IF_ERROR(CheckRange("cameras", cameras, 2, kind == SyntheticKind::kFacade ? 24 : 1000));
  MW_RETURN_IF_ERROR(CheckRange("width", width, 64, 8192));
  MW_RETURN_IF_ERROR(CheckRange("height", height, 64, 8192));
  MW_RETURN_IF_ERROR(CheckRange("noise_sigma", noise_sigma, 0, 50));
  return CheckRange("sparse_points_per_camera", sparse_points_per_camera, 0, 100000);
}

Camera LookAt(const SyntheticOptions& options, double focal_px, const Eigen::Vector3d& center,
              const Eigen::Vector3d& target) {
  Camera camera;
  camera.width = options.width;
  camera.height = options.height;
  camera.fx = camera.fy = focal_px;
  camera.cx = 0.5 * options.width;
  camera.cy = 0.5 * options.height;
  const Eigen::Vector3d forward = (target - center).normalized();
  const Eigen::Vector3d right = forward.cross(Eigen::Vector3d::UnitZ()).normalized();
  camera.cam_from_world.rotation << right.transpose(), forward.cross(right).transpose(), forward.transpose();
  camera.cam_from_world.translation = -(camera.cam_from_world.rotation * center);
  return camera;
}

absl::StatusOr<SyntheticScene> MakeSyntheticScene(const SyntheticOptions& options, ThreadPool& pool) {
  MW_RETURN_IF_ERROR(options.Validate());
  Stage stage = BuildStage(options);
  const MeshRayCaster caster(stage.world.mesh);
  SyntheticScene synthetic;
  synthetic.cameras = std::move(stage.cameras);
  synthetic.images = TakePhotographs(stage.world, caster, synthetic.cameras, options, pool);
  synthetic.scene.format = "synthetic";
  for (size_t i = 0; i < synthetic.cameras.size(); ++i) {
    SceneView view;
    view.name = absl::StrFormat("%04d.png", i);
    view.lens = LensOf(synthetic.cameras[i]);
    view.cam_from_world = synthetic.cameras[i].cam_from_world;
    synthetic.scene.views.push_back(std::move(view));
  }
  synthetic.scene.points = FindSparsePoints(caster, synthetic.cameras, synthetic.images, options, pool);
  synthetic.ground_truth = std::move(stage.world.mesh);
  return synthetic;
}

}  // namespace meshwright
