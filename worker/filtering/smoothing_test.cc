// SPDX-License-Identifier: Apache-2.0
#include "worker/filtering/smoothing.h"

#include <cmath>
#include <functional>
#include <random>

#include <gtest/gtest.h>

namespace meshwright {
namespace {

constexpr double kFocal = 500;
constexpr float kUncertainty = 0.3F;  // footprints

// A surface that is a plane in inverse depth left and another one right of the middle column.
SurfaceEstimate TwoPlanes(const PatchPlane& left, const PatchPlane& right) {
  Lattice lattice{.step = 2, .columns = 40, .rows = 30};
  SurfaceEstimate surface(lattice);
  for (int row = 0; row < lattice.rows; ++row) {
    for (int column = 0; column < lattice.columns; ++column) {
      const PatchPlane& plane = column < lattice.columns / 2 ? left : right;
      surface.plane[static_cast<size_t>(lattice.Index(column, row))] =
          plane.MovedBy(static_cast<float>(2 * column), static_cast<float>(2 * row));
    }
  }
  return surface;
}

double RmsFootprints(const SurfaceEstimate& a, const SurfaceEstimate& b) {
  double sum = 0;
  for (size_t i = 0; i < a.plane.size(); ++i) {
    const double error = (a.plane[i].w - b.plane[i].w) / b.plane[i].w * kFocal;
    sum += error * error;
  }
  return std::sqrt(sum / static_cast<double>(a.plane.size()));
}

void Smooth(SurfaceEstimate& surface, int threads = 2) {
  ThreadPool pool(threads);
  SmoothDepth(std::vector<float>(surface.plane.size(), kUncertainty), kFocal, 2, surface, pool);
}

const PatchPlane kPlane{0.1F, 2e-4F, -1e-4F};

TEST(SmoothDepth, LeavesPlanesAndStepsBetweenThem) {
  const PatchPlane behind{0.1F * (1 - 3 / 500.0F), 2e-4F, -1e-4F};  // three footprints
  const SurfaceEstimate truth = TwoPlanes(kPlane, behind);
  SurfaceEstimate surface = truth;
  Smooth(surface);
  EXPECT_LT(RmsFootprints(surface, truth), 1e-3);
}

TEST(SmoothDepth, TakesNoiseAway) {
  const SurfaceEstimate truth = TwoPlanes(kPlane, kPlane);
  SurfaceEstimate surface = truth;
  std::mt19937 random(5);
  std::normal_distribution<float> noise(0, kUncertainty);
  for (PatchPlane& plane : surface.plane) plane.w *= 1 + noise(random) / static_cast<float>(kFocal);
  const double before = RmsFootprints(surface, truth);
  Smooth(surface);
  EXPECT_LT(RmsFootprints(surface, truth), 0.7 * before);
}

TEST(SmoothDepth, MovesNothingWithoutNeighbours) {
  SurfaceEstimate surface = TwoPlanes(kPlane, kPlane);
  for (size_t i = 0; i < surface.plane.size(); ++i) {
    if (i % 7 != 0) surface.plane[i] = {};
  }
  const SurfaceEstimate before = surface;
  ThreadPool pool(2);
  SmoothDepth(std::vector<float>(surface.plane.size(), 0.1F), kFocal, 2, surface, pool);
  for (size_t i = 0; i < surface.plane.size(); ++i) {
    EXPECT_FLOAT_EQ(surface.plane[i].w, before.plane[i].w);
    EXPECT_EQ(surface.plane[i].gx, before.plane[i].gx);
  }
}

TEST(SmoothDepth, NumberOfThreadsChangesNothing) {
  SurfaceEstimate one = TwoPlanes(kPlane, {0.0999F, -1e-4F, 3e-4F});
  SurfaceEstimate four = one;
  Smooth(one, 1);
  Smooth(four, 4);
  for (size_t i = 0; i < one.plane.size(); ++i) ASSERT_EQ(one.plane[i].w, four.plane[i].w);
}

}  // namespace
}  // namespace meshwright
