// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "common/image/color_image.h"

namespace meshwright {

// `image` must be consistent: 1 x 1 to 65500 x 65500 px, 3 * width * height bytes.
std::string EncodePng(const ColorImage& image);
// `quality`: 1 (smallest) to 100 (best). Colour is stored at full resolution (4:4:4).
std::string EncodeJpeg(const ColorImage& image, int quality);

// The file appears whole or not at all. Errors name the path and the system's reason.
absl::Status WritePng(const std::string& path, const ColorImage& image);

}  // namespace meshwright
