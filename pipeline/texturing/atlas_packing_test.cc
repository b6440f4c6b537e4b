// SPDX-License-Identifier: Apache-2.0
#include "pipeline/texturing/atlas_packing.h"

#include <algorithm>
#include <random>

#include <gtest/gtest.h>

namespace meshwright {
namespace {

TEST(AtlasPackingTest, ChartsKeepTheirDistanceAndPhotographsTheirOrder) {
  std::mt19937 random(3);
  std::vector<Chart> charts;
  for (int32_t label = 0; label < 6; ++label) {
    for (int i = 0; i < 40; ++i) {
      const int x = static_cast<int>(random() % 100);
      charts.push_back({.label = label,
                        .box = {x, 0, x + 1 + static_cast<int>(random() % 90), 1 + static_cast<int>(random() % 60)}});
    }
  }
  const AtlasLayout layout = PackCharts(charts, 256);
  ASSERT_GT(layout.pages.size(), 2U);
  ASSERT_EQ(layout.placements.size(), charts.size());
  std::vector<std::vector<int>> owner(layout.pages.size(), std::vector<int>(256 * 256, 0));
  std::vector<bool> placed(charts.size(), false);
  int32_t last_label = 0;
  int32_t last_page = 0;
  for (const Placement& placement : layout.placements) {
    const Chart& chart = charts[static_cast<size_t>(placement.chart)];
    EXPECT_FALSE(placed[static_cast<size_t>(placement.chart)]);
    placed[static_cast<size_t>(placement.chart)] = true;
    EXPECT_GE(chart.label, last_label);
    last_label = chart.label;
    last_page = std::max(last_page, placement.page);
    EXPECT_GT(placement.page, last_page - kOpenPages);
    const PageSize& page = layout.pages[static_cast<size_t>(placement.page)];
    EXPECT_EQ(page.width % 4 + page.height % 4, 0);
    ASSERT_GE(placement.x, kChartPadding);
    ASSERT_GE(placement.y, kChartPadding);
    ASSERT_LE(placement.x + chart.box.width() + kChartPadding, page.width);
    ASSERT_LE(placement.y + chart.box.height() + kChartPadding, page.height);
    for (int y = placement.y - kChartPadding; y < placement.y + chart.box.height() + kChartPadding; ++y) {
      for (int x = placement.x - kChartPadding; x < placement.x + chart.box.width() + kChartPadding; ++x) {
        int& here = owner[static_cast<size_t>(placement.page)][static_cast<size_t>(256 * y + x)];
        EXPECT_EQ(here, 0);
        here = 1;
      }
    }
  }
}

TEST(AtlasPackingTest, WhatFitsIntoOnePageIsOnOneThatIsHardlyLarger) {
  const std::vector<Chart> charts(100, {.label = 0, .box = {0, 0, 32, 32}});
  const AtlasLayout layout = PackCharts(charts, 4096);
  ASSERT_EQ(layout.pages.size(), 1U);
  EXPECT_LE(layout.pages[0].width * layout.pages[0].height, 100 * 40 * 40 * 3 / 2);
}

}  // namespace
}  // namespace meshwright
