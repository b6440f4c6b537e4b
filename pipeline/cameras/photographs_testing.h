// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "common/base/temporary_folder_testing.h"
#include "common/image/encode.h"

namespace meshwright {

inline ColorImage TestPicture(int width, int height) {
  ColorImage image;
  image.width = width;
  image.height = height;
  image.rgb.resize(size_t{3} * static_cast<size_t>(width) * static_cast<size_t>(height));
  for (size_t i = 0; i < image.rgb.size(); ++i) image.rgb[i] = static_cast<uint8_t>(i * i / 7);
  return image;
}

inline std::string TestJpeg(int width = 64, int height = 48) { return EncodeJpeg(TestPicture(width, height), 90); }

}  // namespace meshwright
