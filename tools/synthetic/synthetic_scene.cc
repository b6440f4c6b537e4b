// SPDX-License-Identifier: Apache-2.0
#include "tools/synthetic/synthetic_scene.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <Eigen/Geometry>
#include <absl/strings/str_format.h>

#include "tools/raycast/mesh_ray_caster.h"
#include "tools/synthetic/hash_noise.h"
#include "tools/synthetic/photographs.h"
#include "tools/synthetic/stage.h"

#include "common/base/status_macros.h"
#include "common/image/decode.h"
#include "common/image/encode.h"

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

// The camera turned so that what it sees moves by about `noise_px` in x and in y, as structure from motion errs.
Rigid3 TurnedPose(const Camera& camera, double noise_px, uint64_t seed) {
  HashRandom random(seed);
  const double angle = noise_px / camera.focal();
  const Eigen::Vector3d turn(angle * random.Normal(), angle * random.Normal(), angle * random.Normal());
  Rigid3 pose = camera.cam_from_world;
  if (turn.norm() > 0) {
    const Eigen::Matrix3d rotation = Eigen::AngleAxisd(turn.norm(), turn.normalized()).toRotationMatrix();
    pose.rotation = rotation * pose.rotation;
    pose.translation = rotation * pose.translation;
  }
  return pose;
}

absl::Status Compress(int quality, std::vector<ColorImage>& images) {
  for (ColorImage& image : images) {
    MW_ASSIGN_OR_RETURN(image, DecodeImageBytes(EncodeJpeg(image, quality), "a synthetic photograph"));
  }
  return absl::OkStatus();
}

Stage BuildStage(const SyntheticOptions& options) {
  switch (options.kind) {
    case SyntheticKind::kRing:
      return BuildRing(options);
    case SyntheticKind::kRoom:
      return BuildRoom(options);
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
    case SyntheticKind::kRoom:
      return "room";
    case SyntheticKind::kStreet:
      return "street";
    case SyntheticKind::kFacade:
      break;
  }
  return "facade";
}

absl::StatusOr<SyntheticKind> ParseSyntheticKind(const std::string& name) {
  for (const SyntheticKind kind :
       {SyntheticKind::kFacade, SyntheticKind::kRing, SyntheticKind::kRoom, SyntheticKind::kStreet}) {
    if (name == SyntheticKindName(kind)) return kind;
  }
  return absl::InvalidArgumentError(
      absl::StrFormat("unknown kind of synthetic scene \"%s\", expected facade, ring, room or street", name));
}

absl::Status SyntheticOptions::Validate() const {
  MW_RETURN_IF_ERROR(CheckRange("cameras", cameras, 2, kind == SyntheticKind::kFacade ? 24 : 10'000));
  MW_RETURN_IF_ERROR(CheckRange("width", width, 64, 8192));
  MW_RETURN_IF_ERROR(CheckRange("height", height, 64, 8192));
  MW_RETURN_IF_ERROR(CheckRange("noise_sigma", noise_sigma, 0, 50));
  MW_RETURN_IF_ERROR(CheckRange("exposure_ev", exposure_ev, 0, 4));
  MW_RETURN_IF_ERROR(CheckRange("jpeg_quality", jpeg_quality, 0, 100));
  MW_RETURN_IF_ERROR(CheckRange("camera_noise_px", camera_noise_px, 0, 20));
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
  if (options.jpeg_quality > 0) MW_RETURN_IF_ERROR(Compress(options.jpeg_quality, synthetic.images));
  synthetic.scene.format = "synthetic";
  for (size_t i = 0; i < synthetic.cameras.size(); ++i) {
    SceneView view;
    view.name = absl::StrFormat("%04d.png", i);
    view.lens = LensOf(synthetic.cameras[i]);
    view.cam_from_world = TurnedPose(synthetic.cameras[i], options.camera_noise_px,
                                     HashBits(options.seed, 204, static_cast<uint64_t>(i)));
    synthetic.scene.views.push_back(std::move(view));
  }
  synthetic.scene.points = FindSparsePoints(caster, synthetic.cameras, synthetic.images, options, pool);
  synthetic.ground_truth = std::move(stage.world.mesh);
  return synthetic;
}

}  // namespace meshwright
