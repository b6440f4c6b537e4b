// SPDX-License-Identifier: Apache-2.0
#include "pipeline/texturing/atlas_packing.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "common/base/check.h"

namespace meshwright {
namespace {

constexpr int kMultiple = 4;
constexpr double kExpectedFill = 0.8;
constexpr double kGrowth = 1.2;

int RoundUp(int size) { return (size + kMultiple - 1) / kMultiple * kMultiple; }

// What is free of a page lies above a line of steps.
class Skyline {
 public:
  Skyline(int width, int height) : width_(width), height_(height), steps_{{0, 0}} {}

  // The lowest place, the leftmost of several.
  std::optional<Placement> Place(int width, int height) {
    size_t best = steps_.size();
    int best_y = height_;
    for (size_t i = 0; i < steps_.size() && steps_[i].x + width <= width_; ++i) {
      int y = 0;
      for (size_t j = i; j < steps_.size() && steps_[j].x < steps_[i].x + width; ++j) y = std::max(y, steps_[j].y);
      if (y + height > height_ || y >= best_y) continue;
      best = i;
      best_y = y;
    }
    if (best == steps_.size()) return std::nullopt;
    const Placement place = {.x = steps_[best].x, .y = best_y};
    Raise(best, width, best_y + height);
    used_height_ = std::max(used_height_, best_y + height);
    return place;
  }

  int used_height() const { return used_height_; }

 private:
  struct Step {
    int x = 0;  // up to the next one
    int y = 0;
  };

  void Raise(size_t first, int width, int y) {
    const int end = steps_[first].x + width;
    size_t next = first;
    int y_behind = 0;
    while (next < steps_.size() && steps_[next].x < end) y_behind = steps_[next++].y;
    const bool reaches = next < steps_.size() ? steps_[next].x == end : end == width_;
    steps_[first].y = y;
    steps_.erase(steps_.begin() + static_cast<std::ptrdiff_t>(first) + 1,
                 steps_.begin() + static_cast<std::ptrdiff_t>(next));
    if (!reaches) steps_.insert(steps_.begin() + static_cast<std::ptrdiff_t>(first) + 1, {end, y_behind});
  }

  const int width_;
  const int height_;
  int used_height_ = 0;
  std::vector<Step> steps_;
};

// Charts of one label, the tallest first.
std::vector<int32_t> SortedByHeight(const std::vector<Chart>& charts, size_t begin, size_t end) {
  std::vector<int32_t> order;
  for (size_t i = begin; i < end; ++i) order.push_back(static_cast<int32_t>(i));
  std::ranges::stable_sort(order, [&](int32_t a, int32_t b) {
    const PixelBox& box_a = charts[static_cast<size_t>(a)].box;
    const PixelBox& box_b = charts[static_cast<size_t>(b)].box;
    if (box_a.height() != box_b.height()) return box_a.height() > box_b.height();
    return box_a.width() > box_b.width();
  });
  return order;
}

AtlasLayout PackIntoPages(const std::vector<Chart>& charts, int size) {
  AtlasLayout layout;
  std::vector<Skyline> pages;
  for (size_t begin = 0; begin < charts.size();) {
    size_t end = begin;
    while (end < charts.size() && charts[end].label == charts[begin].label) ++end;
    for (const int32_t chart : SortedByHeight(charts, begin, end)) {
      const PixelBox& box = charts[static_cast<size_t>(chart)].box;
      const int width = box.width() + 2 * kChartPadding;
      const int height = box.height() + 2 * kChartPadding;
      std::optional<Placement> place;
      size_t page = pages.size() - std::min<size_t>(pages.size(), kOpenPages);
      while (page < pages.size() && !(place = pages[page].Place(width, height)).has_value()) ++page;
      if (!place.has_value()) {
        pages.emplace_back(size, size);
        place = pages.back().Place(width, height);
        MW_CHECK(place.has_value());
      }
      layout.placements.push_back(
          {chart, static_cast<int32_t>(page), place->x + kChartPadding, place->y + kChartPadding});
    }
    begin = end;
  }
  for (const Skyline& page : pages) layout.pages.push_back({size, RoundUp(page.used_height())});
  return layout;
}

}  // namespace

AtlasLayout PackCharts(const std::vector<Chart>& charts, int max_size) {
  double area = 0;
  int least = kMultiple;
  for (const Chart& chart : charts) {
    const int width = chart.box.width() + 2 * kChartPadding;
    const int height = chart.box.height() + 2 * kChartPadding;
    area += static_cast<double>(width) * height;
    least = std::max({least, width, height});
  }
  // One page, as small as possible, if there is one.
  int size = std::max(RoundUp(least), RoundUp(static_cast<int>(std::sqrt(area / kExpectedFill))));
  while (size < max_size) {
    AtlasLayout layout = PackIntoPages(charts, size);
    if (layout.pages.size() <= 1) return layout;
    size = RoundUp(static_cast<int>(size * kGrowth));
  }
  return PackIntoPages(charts, max_size / kMultiple * kMultiple);
}

}  // namespace meshwright
