// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "pipeline/texturing/atlas_packing.h"
#include "pipeline/texturing/chart_painter.h"

#include "common/image/color_image.h"

namespace meshwright {

// A page of the atlas while it is drawn.
class AtlasPage {
 public:
  explicit AtlasPage(const PageSize& size);

  // The top-left pixel of the chart comes to (x, y).
  void Draw(const PaintedChart& chart, int x, int y);

  // What lies between charts gets the colours of what is near, coarser the farther it is away, so that neither mip maps
  // nor JPEG bring foreign colours into charts.
  ColorImage Finish();

 private:
  ColorImage image_;
  std::vector<uint8_t> covered_;
};

}  // namespace meshwright
