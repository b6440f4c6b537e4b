// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "pipeline/texturing/charts.h"

namespace meshwright {

// Where a chart lies in the atlas.
struct Placement {
  int32_t chart = 0;
  int32_t page = 0;
  int x = 0;  // px, of the top-left pixel of the chart's box
  int y = 0;
};

struct PageSize {
  int width = 0;   // px, a multiple of 4
  int height = 0;  // px, a multiple of 4
};

struct AtlasLayout {
  // In the order of drawing: labels ascending, and never on a page before the last but one that was begun. So one
  // photograph and two pages in memory are enough.
  std::vector<Placement> placements;
  std::vector<PageSize> pages;
};

constexpr int kOpenPages = 2;
constexpr int kChartPadding = 4;  // px around a chart that are its own

// Skyline packing, bottom left. `charts` sorted by label; each must fit into a page of max_size x max_size with its
// padding.
AtlasLayout PackCharts(const std::vector<Chart>& charts, int max_size);

}  // namespace meshwright
