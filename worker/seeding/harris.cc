// SPDX-License-Identifier: Apache-2.0
#include "worker/seeding/harris.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <iterator>

#include "common/base/check.h"

// The loops over a row are written for the compiler to vectorise; all arithmetic is element by element, so that the
// width of its vectors does not change a bit of the result.

namespace meshwright {
namespace {

void GreyRow(const uint32_t* quads, int width, float* grey) {
  for (int x = 0; x < width; ++x) grey[x] = static_cast<float>(static_cast<int32_t>(quads[x] & 0xFFU));
}

// Products of the Sobel gradients (8 times grey levels per px) of one row; exact in float.
void GradientProducts(const float* above, const float* here, const float* below, int width, float* __restrict xx,
                      float* __restrict xy, float* __restrict yy) {
  for (int x = 1; x < width - 1; ++x) {
    const float gx = (above[x + 1] - above[x - 1]) + 2.0F * (here[x + 1] - here[x - 1]) + (below[x + 1] - below[x - 1]);
    const float gy = (below[x - 1] - above[x - 1]) + 2.0F * (below[x] - above[x]) + (below[x + 1] - above[x + 1]);
    xx[x] = gx * gx;
    xy[x] = gx * gy;
    yy[x] = gy * gy;
  }
}

// Binomial weights 1 4 6 4 1 down a column.
void BlurDown(const std::array<const float*, 5>& rows, int width, float* __restrict out) {
  const float* r0 = rows[0];
  const float* r1 = rows[1];
  const float* r2 = rows[2];
  const float* r3 = rows[3];
  const float* r4 = rows[4];
  for (int x = 1; x < width - 1; ++x) out[x] = (r0[x] + r4[x]) + 4.0F * (r1[x] + r3[x]) + 6.0F * r2[x];
}

// The same along a row, at x.
inline float BlurAcross(const float* row, int x) {
  return (row[x - 2] + row[x + 2]) + 4.0F * (row[x - 1] + row[x + 1]) + 6.0F * row[x];
}

void ResponseRow(const float* xx, const float* xy, const float* yy, int width, float k, float* __restrict response) {
  constexpr float kScale = 1.0F / (64.0F * 256.0F);  // Sobel's 8 squared, both binomials' 16
  for (int x = 3; x < width - 3; ++x) {
    const float a = kScale * BlurAcross(xx, x);
    const float b = kScale * BlurAcross(xy, x);
    const float c = kScale * BlurAcross(yy, x);
    response[x] = (a * c - b * b) - k * ((a + c) * (a + c));
  }
}

// peaks[x] is the response where it is at least min_response and no smaller than all 8 neighbours, else 0.
void PeakRow(const float* above, const float* here, const float* below, int width, float min_response,
             float* __restrict column_max, float* __restrict peaks) {
  for (int x = 3; x < width - 3; ++x) {
    const float ab = above[x] > below[x] ? above[x] : below[x];
    column_max[x] = ab > here[x] ? ab : here[x];
  }
  for (int x = kHarrisMargin; x < width - kHarrisMargin; ++x) {
    float most = column_max[x - 1] > column_max[x + 1] ? column_max[x - 1] : column_max[x + 1];
    most = most > column_max[x] ? most : column_max[x];
    const bool is_peak = (here[x] >= most) & (here[x] >= min_response);
    peaks[x] = is_peak ? here[x] : 0.0F;
  }
}

// On a plateau the first pixel in reading order is the corner.
bool IsFirstOfPlateau(const float* above, const float* here, int x) {
  return here[x - 1] != here[x] && above[x - 1] != here[x] && above[x] != here[x] && above[x + 1] != here[x];
}

bool Stronger(const Corner& a, const Corner& b) {
  if (a.response != b.response) return a.response > b.response;
  return a.y != b.y ? a.y < b.y : a.x < b.x;
}

// Rows that a filter still needs, in a ring.
class RowRing {
 public:
  RowRing(int rows, int width)
      : rows_(rows), width_(static_cast<size_t>(width)), values_(static_cast<size_t>(rows) * width_) {}
  float* operator[](int y) { return values_.data() + static_cast<size_t>(y % rows_) * width_; }

 private:
  int rows_;
  size_t width_;
  std::vector<float> values_;
};

// Corners of the rows [begin, end), which are one row of cells.
std::vector<Corner> CornersOfStrip(const SamplingImage& image, const HarrisOptions& options, int begin, int end) {
  const SamplingImage::Level& level = image.level(0);
  const int width = level.width;
  const int first = std::max(begin, kHarrisMargin);
  const int last = std::min(end, level.height - kHarrisMargin) - 1;
  std::vector<std::vector<Corner>> cells(static_cast<size_t>((width + options.cell_size - 1) / options.cell_size));
  RowRing grey(3, width);
  RowRing xx(5, width);
  RowRing xy(5, width);
  RowRing yy(5, width);
  RowRing response(3, width);
  RowRing scratch(5, width);
  // Row y of pixels lets row y - 1 of gradients, row y - 3 of responses and row y - 4 of corners be made.
  for (int y = first - 4; y <= last + 4; ++y) {
    GreyRow(level.quads.data() + static_cast<size_t>(y) * static_cast<size_t>(width), width, grey[y]);
    if (y < first - 2) continue;
    GradientProducts(grey[y - 2], grey[y - 1], grey[y], width, xx[y - 1], xy[y - 1], yy[y - 1]);
    if (y < first + 2) continue;
    BlurDown({xx[y - 5], xx[y - 4], xx[y - 3], xx[y - 2], xx[y - 1]}, width, scratch[0]);
    BlurDown({xy[y - 5], xy[y - 4], xy[y - 3], xy[y - 2], xy[y - 1]}, width, scratch[1]);
    BlurDown({yy[y - 5], yy[y - 4], yy[y - 3], yy[y - 2], yy[y - 1]}, width, scratch[2]);
    ResponseRow(scratch[0], scratch[1], scratch[2], width, options.k, response[y - 3]);
    if (y < first + 4) continue;
    const int row = y - 4;
    const float* above = response[row - 1];
    const float* here = response[row];
    float* peaks = scratch[4];
    PeakRow(above, here, response[row + 1], width, options.min_response, scratch[3], peaks);
    for (int x = kHarrisMargin; x < width - kHarrisMargin; ++x) {
      if (peaks[x] <= 0 || !IsFirstOfPlateau(above, here, x) || image.ignored().At(x, row)) continue;
      cells[static_cast<size_t>(x / options.cell_size)].push_back({x, row, peaks[x]});
    }
  }
  std::vector<Corner> corners;
  for (std::vector<Corner>& cell : cells) {
    const auto kept = std::min(cell.size(), static_cast<size_t>(options.corners_per_cell));
    std::partial_sort(cell.begin(), cell.begin() + static_cast<std::ptrdiff_t>(kept), cell.end(), Stronger);
    corners.insert(corners.end(), cell.begin(), cell.begin() + static_cast<std::ptrdiff_t>(kept));
  }
  return corners;
}

}  // namespace

std::vector<Corner> DetectHarrisCorners(const SamplingImage& image, const HarrisOptions& options, ThreadPool& pool) {
  MW_CHECK(options.cell_size >= 4 && options.corners_per_cell >= 1 && options.min_response > 0);
  const SamplingImage::Level& level = image.level(0);
  if (level.width <= 2 * kHarrisMargin || level.height <= 2 * kHarrisMargin) return {};
  const int strips = (level.height + options.cell_size - 1) / options.cell_size;
  std::vector<std::vector<Corner>> of_strip(static_cast<size_t>(strips));
  pool.ParallelFor(strips, 1, [&](int64_t begin, int64_t end) {
    for (int64_t i = begin; i < end; ++i) {
      const int top = static_cast<int>(i) * options.cell_size;
      const int bottom = std::min(top + options.cell_size, level.height);
      of_strip[static_cast<size_t>(i)] = CornersOfStrip(image, options, top, bottom);
    }
  });
  std::vector<Corner> corners;
  for (std::vector<Corner>& strip : of_strip) {
    corners.insert(corners.end(), std::make_move_iterator(strip.begin()), std::make_move_iterator(strip.end()));
  }
  return corners;
}

}  // namespace meshwright
