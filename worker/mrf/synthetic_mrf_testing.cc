// SPDX-License-Identifier: Apache-2.0
#include "worker/mrf/synthetic_mrf_testing.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <vector>

namespace meshwright {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();

// Random values on a coarse lattice, interpolated bilinearly: smooth noise in [0, 1).
class SmoothNoise {
 public:
  SmoothNoise(int columns, int rows, int spacing, std::mt19937& random)
      : spacing_(spacing), width_(columns / spacing + 2), values_(width_ * (rows / spacing + 2)) {
    for (double& value : values_) value = UniformReal(random);
  }

  double At(int column, int row) const {
    const int x = column / spacing_;
    const int y = row / spacing_;
    const double u = static_cast<double>(column % spacing_) / spacing_;
    const double v = static_cast<double>(row % spacing_) / spacing_;
    const double* corner = &values_[y * width_ + x];
    return (1 - v) * ((1 - u) * corner[0] + u * corner[1]) + v * ((1 - u) * corner[width_] + u * corner[width_ + 1]);
  }

 private:
  int spacing_;
  int width_;
  std::vector<double> values_;
};

struct Facet {
  double column, row, depth, slope_column, slope_row;
  double DepthAt(int c, int r) const { return depth + slope_column * (c - column) + slope_row * (r - row); }
};

struct SyntheticPatch {
  float depth = 0.0F;   // in d_r
  int orientation = 0;  // patches of different orientations do not connect
};

}  // namespace

double UniformReal(std::mt19937& random) { return static_cast<double>(random()) / 4294967296.0; }

GridMrf MakeSurfaceMrf(int columns, int rows, uint32_t seed) {
  std::mt19937 random(seed);
  const auto uniform = [&random](double low, double high) { return low + (high - low) * UniformReal(random); };
  std::vector<Facet> facets;
  for (int i = 0; i < std::max(3, columns * rows / 8000); ++i) {
    facets.push_back({uniform(0, columns), uniform(0, rows), uniform(0, 60), uniform(-1, 1), uniform(-1, 1)});
  }
  const SmoothNoise covered(columns, rows, 37, random);
  const SmoothNoise doubled(columns, rows, 23, random);
  const SmoothNoise false_surface(columns, rows, 19, random);
  const SmoothNoise false_depth(columns, rows, 29, random);

  auto patches = std::make_shared<std::vector<SyntheticPatch>>();
  GridMrf mrf;
  mrf.columns = columns;
  mrf.rows = rows;
  mrf.first_patch.push_back(0);
  const auto add = [&](double depth, int orientation, double quality) {
    patches->push_back({static_cast<float>(depth), orientation});
    mrf.patch_cost.push_back(static_cast<float>(-(quality + 1) / 2));
  };
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      const auto squared_distance = [&](const Facet& facet) {
        return (facet.column - column) * (facet.column - column) + (facet.row - row) * (facet.row - row);
      };
      const auto facet = std::min_element(facets.begin(), facets.end(), [&](const Facet& a, const Facet& b) {
        return squared_distance(a) < squared_distance(b);
      });
      const double depth = facet->DepthAt(column, row);
      const int orientation = static_cast<int>(facet - facets.begin()) % 3;
      if (covered.At(column, row) > 0.5) {
        if (uniform(0, 1) < 0.96) add(depth + uniform(-0.6, 0.6), orientation, uniform(0.7, 0.98));
        if (doubled.At(column, row) > 0.65 && uniform(0, 1) < 0.8) {
          add(depth + 2 + uniform(-0.5, 0.5), orientation, uniform(0.65, 0.95));
        }
        if (uniform(0, 1) < 0.05) add(uniform(0, 60), 3, uniform(0.6, 0.9));
      }
      if (false_surface.At(column, row) > 0.7 && uniform(0, 1) < 0.9) {
        add(120 * false_depth.At(column, row) + uniform(-1.5, 1.5), 4, uniform(0.6, 0.8));
      }
      mrf.first_patch.push_back(static_cast<int32_t>(mrf.patch_cost.size()));
    }
  }
  mrf.pairwise = [patches](int32_t s, int32_t t) {
    const SyntheticPatch& a = (*patches)[s];
    const SyntheticPatch& b = (*patches)[t];
    const float step = a.depth - b.depth;
    const float delta = std::sqrt(1.0F + step * step) / 5.0F;
    return delta <= 1.0F && a.orientation == b.orientation ? delta : kInfinity;
  };
  return mrf;
}

GridMrf MakeRandomMrf(int columns, int rows, int max_patches, double infinite_share, std::mt19937& random) {
  GridMrf mrf;
  mrf.columns = columns;
  mrf.rows = rows;
  mrf.first_patch.push_back(0);
  for (int node = 0; node < columns * rows; ++node) {
    const int count = static_cast<int>(UniformReal(random) * (max_patches + 1));
    for (int i = 0; i < count; ++i) mrf.patch_cost.push_back(static_cast<float>(-0.8 - 0.2 * UniformReal(random)));
    mrf.first_patch.push_back(static_cast<int32_t>(mrf.patch_cost.size()));
  }
  const size_t patch_count = mrf.patch_cost.size();
  auto costs = std::make_shared<std::vector<float>>(patch_count * patch_count);
  for (float& cost : *costs) {
    cost = UniformReal(random) < infinite_share ? kInfinity : static_cast<float>(UniformReal(random));
  }
  mrf.pairwise = [costs, patch_count](int32_t s, int32_t t) { return (*costs)[s * patch_count + t]; };
  return mrf;
}

}  // namespace meshwright
