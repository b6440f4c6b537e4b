// SPDX-License-Identifier: Apache-2.0
#include "common/image/color_image.h"

namespace meshwright {

GreyImage ToGrey(const ColorImage& image) {
  GreyImage grey{.width = image.width, .height = image.height, .grey = {}};
  grey.grey.resize(image.rgb.size() / 3);
  for (size_t i = 0; i < grey.grey.size(); ++i) {
    const unsigned red = image.rgb[3 * i];
    const unsigned green = image.rgb[3 * i + 1];
    const unsigned blue = image.rgb[3 * i + 2];
    grey.grey[i] = static_cast<uint8_t>((77 * red + 150 * green + 29 * blue + 128) >> 8);
  }
  return grey;
}

}  // namespace meshwright
