// SPDX-License-Identifier: Apache-2.0
#include "coordinator/nodeodm/odm_cameras.h"

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Geometry>
#include <absl/strings/str_cat.h>

namespace meshwright {
namespace {

using Json = nlohmann::ordered_json;

// OpenSfM's model with the names of its coefficients; what it does not have keeps our names, which no reader takes for
// something else.
std::pair<const char*, std::vector<const char*>> ModelOf(const Lens& lens) {
  switch (lens.model) {
    case Lens::Model::kPinhole:
      return {"brown", {}};
    case Lens::Model::kRadial:
      return {"brown", {"k1", "k2"}};
    case Lens::Model::kOpenCv:
      return {"brown", {"k1", "k2", "p1", "p2"}};
    case Lens::Model::kFullOpenCv:
      return {"full_opencv", {"k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"}};
    case Lens::Model::kOpenCvFisheye:
      return {"fisheye_opencv", {"k1", "k2", "k3", "k4"}};
    case Lens::Model::kRadialFisheye:
      return {"fisheye_opencv", {"k1", "k2"}};
    case Lens::Model::kFov:
      return {"fov", {"omega"}};
    case Lens::Model::kThinPrismFisheye:
      return {"thin_prism_fisheye", {"k1", "k2", "p1", "p2", "k3", "k4", "sx1", "sy1"}};
  }
  return {"brown", {}};
}

Json CameraOf(const Lens& lens) {
  const double size = std::max(lens.width, lens.height);
  const auto [model, names] = ModelOf(lens);
  Json camera = {{"projection_type", model},
                 {"width", lens.width},
                 {"height", lens.height},
                 {"focal_x", lens.fx / size},
                 {"focal_y", lens.fy / size},
                 {"c_x", (lens.cx - 0.5 * lens.width) / size},
                 {"c_y", (lens.cy - 0.5 * lens.height) / size}};
  // Readers of "brown" want all five.
  if (std::string(model) == "brown") {
    for (const char* name : {"k1", "k2", "p1", "p2", "k3"}) camera[name] = 0.0;
  }
  for (size_t i = 0; i < names.size(); ++i) camera[names[i]] = lens.coefficients[i];
  return camera;
}

// Equal lenses have equal names.
std::string NameOf(const Lens& lens, const std::vector<Json>& cameras) {
  const Json camera = CameraOf(lens);
  const auto found = std::find(cameras.begin(), cameras.end(), camera);
  return absl::StrCat("camera ", found - cameras.begin() + 1, " ", lens.width, " ", lens.height);
}

std::vector<Json> DifferentCameras(const Scene& scene) {
  std::vector<Json> cameras;
  for (const SceneView& view : scene.views) {
    Json camera = CameraOf(view.lens);
    if (std::find(cameras.begin(), cameras.end(), camera) == cameras.end()) cameras.push_back(std::move(camera));
  }
  return cameras;
}

Json ToArray(const Eigen::Vector3d& vector) { return Json::array({vector.x(), vector.y(), vector.z()}); }

}  // namespace

Json OdmCameras(const Scene& scene) {
  const std::vector<Json> cameras = DifferentCameras(scene);
  Json all = Json::object();
  for (const SceneView& view : scene.views) all[NameOf(view.lens, cameras)] = CameraOf(view.lens);
  return all;
}

Json OdmShots(const Scene& scene) {
  const std::vector<Json> cameras = DifferentCameras(scene);
  Json features = Json::array();
  for (const SceneView& view : scene.views) {
    const Eigen::AngleAxisd turn(view.cam_from_world.rotation);
    const double size = std::max(view.lens.width, view.lens.height);
    features.push_back({{"type", "Feature"},
                        {"properties",
                         {{"filename", view.name},
                          {"camera", NameOf(view.lens, cameras)},
                          {"focal", view.lens.fx / size},
                          {"width", view.lens.width},
                          {"height", view.lens.height},
                          {"translation", ToArray(Inverse(view.cam_from_world).translation)},
                          {"rotation", ToArray(turn.angle() * turn.axis())}}},
                        {"geometry", nullptr}});
  }
  return {{"type", "FeatureCollection"}, {"features", features}};
}

Json OdmImages(const Scene& scene) {
  Json images = Json::array();
  for (const SceneView& view : scene.views) {
    images.push_back({{"filename", view.name}, {"width", view.lens.width}, {"height", view.lens.height}});
  }
  return images;
}

}  // namespace meshwright
