// SPDX-License-Identifier: Apache-2.0
#include "worker/mrf/solve.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "worker/mrf/synthetic_mrf_testing.h"

namespace meshwright {
namespace {

using testing::Each;
using testing::HasSubstr;

constexpr float kInfinity = std::numeric_limits<float>::infinity();

double BruteForceMinimum(const GridMrf& mrf) {
  std::vector<uint8_t> labels(mrf.NodeCount(), 0);
  double best = MrfEnergy(mrf, labels);
  for (;;) {
    int node = 0;
    while (node < mrf.NodeCount() && labels[node] == mrf.PatchCount(node)) labels[node++] = 0;
    if (node == mrf.NodeCount()) return best;
    ++labels[node];
    best = std::min(best, MrfEnergy(mrf, labels));
  }
}

// The same grid seen by windows of 4 nodes and a margin of 1.
TrwsOptions TinyWindows() {
  TrwsOptions options;
  options.window_nodes = 4;
  options.margin_nodes = 1;
  return options;
}

void ExpectConsistent(const GridMrf& mrf, const MrfSolution& solution) {
  ASSERT_EQ(solution.labels.size(), static_cast<size_t>(mrf.NodeCount()));
  for (int node = 0; node < mrf.NodeCount(); ++node) EXPECT_LE(solution.labels[node], mrf.PatchCount(node));
  EXPECT_EQ(solution.energy, MrfEnergy(mrf, solution.labels));
  EXPECT_TRUE(std::isfinite(solution.energy));
  if (solution.windows == 1) {
    EXPECT_LE(solution.energy, mrf.NodeCount() * static_cast<double>(mrf.label0_cost) + 1e-6);
  }
  EXPECT_LE(solution.lower_bound, solution.energy);
}

TEST(SolveMrf, ExactOnChains) {
  std::mt19937 random(1);
  for (int trial = 0; trial < 40; ++trial) {
    const int length = 1 + trial % 9;
    const bool row = trial % 2 == 0;
    const GridMrf mrf = MakeRandomMrf(row ? length : 1, row ? 1 : length, 3, 0.3, random);
    TrwsOptions options;
    options.message_tolerance = 0.0;
    const MrfSolution solution = SolveGlobal(mrf, options);
    ExpectConsistent(mrf, solution);
    const double minimum = BruteForceMinimum(mrf);
    EXPECT_NEAR(solution.energy, minimum, 1e-5);
    EXPECT_NEAR(solution.lower_bound, minimum, 1e-5);
  }
}

TEST(SolveMrf, ExactOnLoopsWhenSubmodular) {
  // One patch per node and no infinite cost: theta(0,0) + theta(1,1) <= theta(0,1) + theta(1,0).
  std::mt19937 random(2);
  for (int trial = 0; trial < 30; ++trial) {
    GridMrf mrf = MakeRandomMrf(4, 4, 1, 0.0, random);
    for (float& cost : mrf.patch_cost) cost = static_cast<float>(3 * UniformReal(random) - 1.5);
    TrwsOptions options;
    options.max_iterations = 500;
    options.message_tolerance = 0.0;
    const MrfSolution solution = SolveGlobal(mrf, options);
    ExpectConsistent(mrf, solution);
    const double minimum = BruteForceMinimum(mrf);
    EXPECT_NEAR(solution.energy, minimum, 1e-4);
    EXPECT_NEAR(solution.lower_bound, minimum, 1e-3);
  }
}

TEST(SolveMrf, BoundsEncloseTheMinimumOnLoops) {
  std::mt19937 random(3);
  double energies = 0.0;
  double minima = 0.0;
  for (int trial = 0; trial < 60; ++trial) {
    const GridMrf mrf = MakeRandomMrf(trial % 2 == 0 ? 3 : 4, 3, 2, 0.1 * (trial % 6), random);
    const double minimum = BruteForceMinimum(mrf);
    ThreadPool pool(1);
    for (const MrfSolution& solution : {SolveGlobal(mrf, TrwsOptions{}), SolveInWindows(mrf, TrwsOptions{}, pool)}) {
      ExpectConsistent(mrf, solution);
      EXPECT_GE(solution.energy, minimum - 1e-5);
      EXPECT_LE(solution.lower_bound, minimum + 1e-5);
      energies += solution.energy;
      minima += minimum;
    }
  }
  EXPECT_LE(energies, minima + 0.01 * std::abs(minima));
}

TEST(SolveMrf, EqualsBruteForceOnSurfaces) {
  int solved = 0;
  for (uint32_t seed = 0; seed < 40; ++seed) {
    const GridMrf mrf = MakeSurfaceMrf(4, 3, seed);
    const MrfSolution solution = SolveGlobal(mrf, TrwsOptions{});
    ExpectConsistent(mrf, solution);
    const double minimum = BruteForceMinimum(mrf);
    EXPECT_NEAR(solution.energy, minimum, 1e-5) << "seed " << seed;
    EXPECT_LE(solution.lower_bound, minimum + 1e-5);
    if (solution.energy < mrf.NodeCount()) ++solved;
  }
  EXPECT_GE(solved, 10);  // not all of them are empty
}

TEST(SolveMrf, WindowsBoundHoldsForTheWholeGrid) {
  // Adversarial for windows: hardly larger than their margin and no coherence to build on.
  std::mt19937 random(4);
  ThreadPool pool(2);
  for (int trial = 0; trial < 10; ++trial) {
    const GridMrf mrf = MakeRandomMrf(12, 11, 3, 0.4, random);
    const MrfSolution windows = SolveInWindows(mrf, TinyWindows(), pool);
    EXPECT_EQ(windows.windows, 9);
    ExpectConsistent(mrf, windows);
    const MrfSolution global = SolveGlobal(mrf, TrwsOptions{});
    EXPECT_LE(windows.lower_bound, global.energy + 1e-4);
    EXPECT_LE(global.lower_bound, windows.energy + 1e-4);
  }
  for (int trial = 0; trial < 10; ++trial) {
    const GridMrf mrf = MakeRandomMrf(9, 2, 1, 0.3, random);
    const MrfSolution windows = SolveInWindows(mrf, TinyWindows(), pool);
    const double minimum = BruteForceMinimum(mrf);
    EXPECT_LE(windows.lower_bound, minimum + 1e-5);
    EXPECT_GE(windows.energy, minimum - 1e-5);
  }
}

TEST(SolveMrf, WindowsAreAsGoodAsTheGlobalRunOnSurfaces) {
  const GridMrf mrf = MakeSurfaceMrf(400, 300, 5);
  TrwsOptions options;
  options.window_nodes = 120;
  ThreadPool pool(2);
  const MrfSolution global = SolveGlobal(mrf, options);
  const MrfSolution windows = SolveInWindows(mrf, options, pool);
  ExpectConsistent(mrf, global);
  ExpectConsistent(mrf, windows);
  EXPECT_EQ(windows.windows, 12);
  // Relative to what the surface earns: the energy's own zero is arbitrary.
  const double gain = mrf.NodeCount() - global.energy;
  EXPECT_GT(gain, 0.2 * mrf.NodeCount());
  EXPECT_LE(windows.energy, global.energy + 0.001 * gain);
  EXPECT_LE(global.energy - global.lower_bound, 0.005 * gain);
  EXPECT_LE(windows.energy - windows.lower_bound, 0.005 * gain);
}

TEST(SolveMrf, BoundDoesNotDecrease) {
  const GridMrf mrf = MakeSurfaceMrf(80, 60, 6);
  TrwsOptions options;
  options.message_tolerance = 0.0;
  const MrfSolution solution = SolveGlobal(mrf, options);
  ASSERT_GT(solution.bound_trace.size(), 3U);
  for (size_t i = 1; i < solution.bound_trace.size(); ++i) {
    EXPECT_GE(solution.bound_trace[i], solution.bound_trace[i - 1] - 1e-3);
  }
  EXPECT_NEAR(solution.lower_bound, solution.bound_trace.back(), 0.1);
}

TEST(SolveMrf, ResultDoesNotDependOnThreads) {
  const GridMrf mrf = MakeSurfaceMrf(300, 280, 7);
  TrwsOptions options;
  options.window_nodes = 60;
  options.margin_nodes = 20;
  ThreadPool one(1);
  const MrfSolution expected = SolveInWindows(mrf, options, one);
  for (const int threads : {2, 5}) {
    ThreadPool pool(threads);
    const MrfSolution solution = SolveInWindows(mrf, options, pool);
    EXPECT_EQ(solution.labels, expected.labels);
    EXPECT_EQ(solution.energy, expected.energy);
    EXPECT_EQ(solution.lower_bound, expected.lower_bound);
    EXPECT_EQ(solution.iterations, expected.iterations);
  }
}

TEST(SolveMrf, OneWindowIsTheGlobalRun) {
  const GridMrf mrf = MakeSurfaceMrf(70, 50, 8);
  ThreadPool pool(2);
  const MrfSolution windows = SolveInWindows(mrf, TrwsOptions{}, pool);
  const MrfSolution global = SolveGlobal(mrf, TrwsOptions{});
  EXPECT_EQ(windows.labels, global.labels);
  EXPECT_EQ(windows.lower_bound, global.lower_bound);
}

TEST(SolveMrf, EmptyGrid) {
  GridMrf mrf;
  mrf.first_patch = {0};
  ThreadPool pool(1);
  EXPECT_EQ(SolveGlobal(mrf, TrwsOptions{}).energy, 0.0);
  EXPECT_EQ(SolveInWindows(mrf, TrwsOptions{}, pool).lower_bound, 0.0);
}

TEST(SolveMrf, NodesWithoutPatches) {
  GridMrf mrf;
  mrf.columns = 9;
  mrf.rows = 7;
  mrf.first_patch.assign(64, 0);
  ThreadPool pool(1);
  const MrfSolution solution = SolveInWindows(mrf, TinyWindows(), pool);
  EXPECT_THAT(solution.labels, Each(0));
  EXPECT_EQ(solution.energy, 63.0);
  EXPECT_EQ(solution.lower_bound, 63.0);
}

TEST(SolveMrf, SingleNode) {
  GridMrf mrf;
  mrf.columns = 1;
  mrf.rows = 1;
  mrf.first_patch = {0, 2};
  mrf.patch_cost = {-0.8F, -0.9F};
  mrf.pairwise = [](int32_t, int32_t) { return kInfinity; };
  const MrfSolution solution = SolveGlobal(mrf, TrwsOptions{});
  EXPECT_EQ(solution.labels, std::vector<uint8_t>{2});
  EXPECT_FLOAT_EQ(solution.energy, -0.9F);
  EXPECT_FLOAT_EQ(solution.lower_bound, -0.9F);
}

TEST(SolveMrf, InfinitePairwiseEverywhere) {
  // No two neighbours may have patches, and a lone patch costs 4 e0 - 0.9 - 1 > 0 more than none; at a corner 2 e0 ...
  std::mt19937 random(9);
  GridMrf mrf = MakeRandomMrf(13, 9, 3, 1.0, random);
  ThreadPool pool(1);
  EXPECT_THAT(SolveInWindows(mrf, TinyWindows(), pool).labels, Each(0));
  // ... and with a smaller e0 patches pay, but never two side by side.
  mrf.boundary_cost = 0.1F;
  const MrfSolution solution = SolveInWindows(mrf, TinyWindows(), pool);
  ExpectConsistent(mrf, solution);
  EXPECT_LT(solution.energy, 0.8 * mrf.NodeCount());
}

TEST(TrwsOptions, ValidateNamesFieldAndValue) {
  EXPECT_TRUE(TrwsOptions{}.Validate().ok());
  TrwsOptions options;
  options.max_iterations = 0;
  EXPECT_THAT(std::string(options.Validate().message()), HasSubstr("max_iterations is 0"));
  options = {};
  options.message_tolerance = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(std::string(options.Validate().message()), HasSubstr("message_tolerance is nan"));
  options = {};
  options.margin_nodes = 0;
  EXPECT_THAT(std::string(options.Validate().message()), HasSubstr("margin_nodes is 0"));
  options = {};
  options.window_nodes = 101;
  EXPECT_THAT(std::string(options.Validate().message()), HasSubstr("window_nodes is 101"));
}

}  // namespace
}  // namespace meshwright
