#pragma once

#include <memory>
#include <string>

#include <absl/status/statusor.h>

#include "common/geometry/camera.h"
#include "common/image/color_image.h"
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
};

// Decodes view.image_path (EXIF rotation ignored), checks its size against the lens, undistorts and scales.
// Errors name the file and what was expected: NotFound, InvalidArgument (not a picture, truncated, wrong size).
absl::StatusOr<View> LoadView(const SceneView& view, int max_image_size);

// The same for a picture's bytes, wherever they come from; view.image_path stands for the file in errors.
absl::StatusOr<View> DecodeView(const SceneView& view, const std::string& picture_bytes, int max_image_size);

}  // namespace meshwright
// SPDX-License-Identifier: Apache-2.0
