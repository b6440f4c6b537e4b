// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>

#include <absl/status/statusor.h>

#include "common/geometry/camera.h"
#include "common/image/color_image.h"
#include "common/image/ignored_pixels.h"
#include "common/scene/scene.h"

namespace meshwright {

// The pinhole camera that a view gets after undistortion and scaling: exact, known without touching the picture.
// `max_image_size`: longest side in px, 0 for "as it is". Images and cameras are scaled alike; pictures are never
// enlarged. When the lens distorts or has skew, the pinhole camera is chosen so that every pixel of it has a source.
Camera UndistortedCamera(const SceneView& view, int max_image_size);

// A view ready for use: decoded, undistorted, scaled. `camera` equals UndistortedCamera of the same arguments.
struct View {
  Camera camera;
  ColorImage color;
  IgnoredPixels ignored;  // of color
};

// Decodes view.image_path and its mask (EXIF rotation ignored), checks its size against the lens, undistorts and
// scales. Errors name the file and what was expected: NotFound, InvalidArgument (not a picture, truncated, wrong size).
absl::StatusOr<View> LoadView(const SceneView& view, int max_image_size);

// The same for a picture's and a mask's bytes, wherever they come from; view.image_path and view.mask_path stand for
// the files in errors. Without a mask_path `mask_bytes` are not looked at. A mask may be smaller or larger than its
// picture by one factor.
absl::StatusOr<View> DecodeView(const SceneView& view, const std::string& picture_bytes, const std::string& mask_bytes,
                                int max_image_size);

// Decodes a mask for a picture of this size, black and white as BlackAndWhite makes it. InvalidArgument: not a picture,
// or a size that is not the picture's but for one factor.
absl::StatusOr<ColorImage> DecodeMask(const SceneView& view, const std::string& mask_bytes);

}  // namespace meshwright
