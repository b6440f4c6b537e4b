// SPDX-License-Identifier: Apache-2.0
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
  MW_ASSIGN_OR_RETURN(const std::string picture, ReadFile(view.image_path));
  std::string mask;
  if (!view.mask_path.empty()) {
    MW_ASSIGN_OR_RETURN(mask, ReadFile(view.mask_path));
  }
  return DecodeView(view, picture, mask, max_image_size);
}

absl::StatusOr<ColorImage> DecodeMask(const SceneView& view, const std::string& mask_bytes) {
  MW_ASSIGN_OR_RETURN(ColorImage mask, DecodeImageBytes(mask_bytes, view.mask_path));
  const int width = view.lens.width;
  const int height = view.lens.height;
  const double factor = static_cast<double>(mask.width) / width;
  if (std::abs(factor * height - mask.height) > std::max(1.0, factor)) {
    return absl::InvalidArgumentError(absl::StrCat(view.mask_path, ": the mask has ", mask.width, " x ", mask.height,
                                                   " px; expected its picture's ", width, " x ", height,
                                                   ", or one factor of it"));
  }
  // JPEG leaves grey around edges.
  constexpr int kLeastWhiteOfJpeg = 128;
  const bool is_jpeg = mask_bytes.size() > 2 && mask_bytes.compare(0, 2, "\xFF\xD8") == 0;
  mask = BlackAndWhite(std::move(mask), is_jpeg ? kLeastWhiteOfJpeg : 1);
  if (mask.width == width && mask.height == height) return mask;
  ColorImage scaled{.width = width, .height = height, .rgb = {}};
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const auto sample = mask.At(static_cast<int>(int64_t{x} * mask.width / width),
                                  static_cast<int>(int64_t{y} * mask.height / height));
      scaled.rgb.insert(scaled.rgb.end(), sample.begin(), sample.end());
    }
  }
  return scaled;
}

absl::StatusOr<View> DecodeView(const SceneView& view, const std::string& picture_bytes, const std::string& mask_bytes,
                                int max_image_size) {
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
  const Camera camera = UndistortedCamera(view, max_image_size);
  const auto prepare = [&](ColorImage source) {
    if (!view.lens.is_plain_pinhole()) source = Undistort(source, view.lens, pinhole);
    return ReduceByArea(source, camera.width, camera.height);
  };
  View prepared{.camera = camera, .color = prepare(std::move(image)), .ignored = {}};
  if (!view.mask_path.empty()) {
    // A pixel that has anything of a black one is not white any more: nothing that the mask hides is left.
    MW_ASSIGN_OR_RETURN(ColorImage mask, DecodeMask(view, mask_bytes));
    prepared.ignored = IgnoredPixels(prepare(std::move(mask)));
  }
  return prepared;
}

}  // namespace meshwright
