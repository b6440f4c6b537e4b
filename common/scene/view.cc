#include "common/scene/view.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include <absl/status/status.h>
#include <absl/strings/str_cat.h>

#include "common/base/files.h"
#include "common/base/status_macros.h"
#include "common/image/decode.h"
#include "common/image/remap.h"
#include "common/image/resize.h"
#include "common/scene/undistorted_pinhole.h"

namespace meshwright {
namespace {

Camera Scaled(Camera camera, int max_image_size) {
  const int longest = std::max(camera.width, camera.height);
  if (max_image_size <= 0 || longest <= max_image_size) return camera;
  const double scale = static_cast<double>(max_image_size) / longest;
  const int width = std::max(1, static_cast<int>(std::lround(camera.width * scale)));
  const int height = std::max(1, static_cast<int>(std::lround(camera.height * scale)));
  // Sizes are whole pixels, so the two axes scale by slightly different factors.
  const double scale_x = static_cast<double>(width) / camera.width;
  const double scale_y = static_cast<double>(height) / camera.height;
  camera.width = width;
  camera.height = height;
  camera.fx *= scale_x;
  camera.cx *= scale_x;
  camera.fy *= scale_y;
  camera.cy *= scale_y;
  return camera;
}

ColorImage Undistort(const ColorImage& image, const Lens& lens, const Camera& pinhole) {
  return Remap(image, pinhole.width, pinhole.height, [&](int row, std::vector<SourcePosition>* sources) {
    for (size_t column = 0; column < sources->size(); ++column) {
      const Eigen::Vector3d ray = pinhole.RayInCam(static_cast<double>(column) + 0.5, row + 0.5);
      const Eigen::Vector2d pixel = lens.PixelFromPlane(ray.head<2>());
      (*sources)[column] = {pixel.x(), pixel.y()};
    }
  });
}

}  // namespace

Camera UndistortedCamera(const SceneView& view, int max_image_size) {
  Camera camera = Scaled(LargestPinhole(view.lens), max_image_size);
  camera.cam_from_world = view.cam_from_world;
  return camera;
}

absl::StatusOr<View> LoadView(const SceneView& view, int max_image_size) {
  MW_ASSIGN_OR_RETURN(const std::string bytes, ReadFile(view.image_path));
  return DecodeView(view, bytes, max_image_size);
}

absl::StatusOr<View> DecodeView(const SceneView& view, const std::string& picture_bytes, int max_image_size) {
  MW_ASSIGN_OR_RETURN(ColorImage image, DecodeImageBytes(picture_bytes, view.image_path));
  if (image.width != view.lens.width || image.height != view.lens.height) {
    return absl::InvalidArgumentError(absl::StrCat(view.image_path, ": the picture has ", image.width, " x ",
                                                   image.height, " px; its camera expects ", view.lens.width, " x ",
                                                   view.lens.height));
  }
  const Camera pinhole = LargestPinhole(view.lens);
  if (pinhole.width < 1 || pinhole.height < 1) {
    return absl::InvalidArgumentError(
        absl::StrCat(view.image_path, ": its camera's distortion leaves no rectangle to undistort to"));
  }
  if (!view.lens.is_plain_pinhole()) image = Undistort(image, view.lens, pinhole);
  const Camera camera = UndistortedCamera(view, max_image_size);
  return View{.camera = camera, .color = ReduceByArea(image, camera.width, camera.height)};
}

}  // namespace meshwright
// SPDX-License-Identifier: Apache-2.0
