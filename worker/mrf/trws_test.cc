// SPDX-License-Identifier: Apache-2.0
#include "worker/mrf/trws.h"

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

// A pairwise energy on a grid with all labels and all nodes written out, label 0 included.
struct DenseEnergy {
  struct Edge {
    int s, t;
    std::vector<std::vector<double>> cost;  // [label of s][label of t]
  };
  std::vector<std::vector<double>> unary;
  std::vector<Edge> edges;
};

// TRW-S as in Kolmogorov 2006, figure 3, on dense tables: the slow twin. One message vector per edge and direction, all
// labels alike, each normalised to a minimum of 0. Returns the bound after each forward pass.
std::vector<double> TextbookBoundTrace(const DenseEnergy& energy, int iterations) {
  const int count = static_cast<int>(energy.unary.size());
  std::vector<std::vector<double>> into_s, into_t;
  std::vector<int> earlier(count, 0);
  std::vector<int> later(count, 0);
  for (const DenseEnergy::Edge& edge : energy.edges) {
    into_s.emplace_back(energy.unary[edge.s].size(), 0.0);
    into_t.emplace_back(energy.unary[edge.t].size(), 0.0);
    ++later[edge.s];
    ++earlier[edge.t];
  }
  std::vector<double> trace;
  for (int pass = 0; pass < 2 * iterations; ++pass) {
    const bool forward = pass % 2 == 0;
    double bound = 0.0;
    for (int i = 0; i < count; ++i) {
      const int s = forward ? i : count - 1 - i;
      std::vector<double> cost = energy.unary[s];
      for (size_t e = 0; e < energy.edges.size(); ++e) {
        const std::vector<double>& message = energy.edges[e].s == s ? into_s[e] : into_t[e];
        if (energy.edges[e].s != s && energy.edges[e].t != s) continue;
        for (size_t j = 0; j < cost.size(); ++j) cost[j] += message[j];
      }
      const double node_minimum = *std::min_element(cost.begin(), cost.end());
      bound += node_minimum;
      const double share = 1.0 / std::max({1, earlier[s], later[s]});
      for (size_t e = 0; e < energy.edges.size(); ++e) {
        const DenseEnergy::Edge& edge = energy.edges[e];
        if ((forward ? edge.s : edge.t) != s) continue;
        const std::vector<double>& back = forward ? into_s[e] : into_t[e];
        std::vector<double>& out = forward ? into_t[e] : into_s[e];
        for (size_t k = 0; k < out.size(); ++k) {
          out[k] = std::numeric_limits<double>::infinity();
          for (size_t j = 0; j < cost.size(); ++j) {
            const double pair = forward ? edge.cost[j][k] : edge.cost[k][j];
            out[k] = std::min(out[k], share * (cost[j] - node_minimum) - back[j] + pair);
          }
        }
        const double delta = *std::min_element(out.begin(), out.end());
        for (double& value : out) value -= delta;
        bound += delta;
      }
    }
    if (forward) trace.push_back(bound);
  }
  return trace;
}

// Both forms of one random energy: u in [-1, 3], phi in [-2, -1] or infinite; some nodes and edges are missing.
struct Pair {
  TrwsProblem problem;
  DenseEnergy dense;
};

Pair MakeRandomPair(int columns, int rows, int max_patches, double infinite_share, std::mt19937& random) {
  Pair pair;
  std::vector<int> at(static_cast<size_t>(columns) * rows, -1);
  for (int cell = 0; cell < columns * rows; ++cell) {
    const int count = static_cast<int>(UniformReal(random) * (max_patches + 1));
    if (count == 0) continue;
    float* unary = pair.problem.AddNode(count);
    const int s = pair.problem.node_count() - 1;
    at[cell] = s;
    pair.dense.unary.emplace_back(count + 1, 0.0);
    for (int j = 0; j < count; ++j) {
      pair.dense.unary[s][j + 1] = unary[j] = static_cast<float>(4 * UniformReal(random) - 1);
    }
    const auto join = [&](int other, Side side) {
      float* table = pair.problem.AddEdge(other, side, s);
      const int other_count = pair.problem.node(other).patch_count;
      DenseEnergy::Edge edge{other, s, {}};
      edge.cost.assign(other_count + 1, std::vector<double>(count + 1, 0.0));
      for (int i = 0; i < other_count; ++i) {
        for (int j = 0; j < count; ++j) {
          const bool infinite = UniformReal(random) < infinite_share;
          const float phi =
              infinite ? std::numeric_limits<float>::infinity() : static_cast<float>(UniformReal(random) - 2);
          edge.cost[i + 1][j + 1] = table[i * count + j] = phi;
        }
      }
      pair.dense.edges.push_back(std::move(edge));
    };
    if (cell % columns > 0 && at[cell - 1] >= 0) join(at[cell - 1], kRight);
    if (cell >= columns && at[cell - columns] >= 0) join(at[cell - columns], kDown);
  }
  return pair;
}

double DenseCost(const DenseEnergy& energy, const std::vector<uint8_t>& labels) {
  double cost = 0.0;
  for (size_t s = 0; s < labels.size(); ++s) cost += energy.unary[s][labels[s]];
  for (const DenseEnergy::Edge& edge : energy.edges) cost += edge.cost[labels[edge.s]][labels[edge.t]];
  return cost;
}

TEST(Trws, BoundTraceIsThatOfTheTextbook) {
  std::mt19937 random(11);
  for (const auto& [columns, rows] : {std::pair{1, 1}, {7, 1}, {1, 9}, {2, 2}, {5, 4}, {13, 11}, {30, 20}}) {
    for (const int max_patches : {1, 3, 10}) {
      Pair pair = MakeRandomPair(columns, rows, max_patches, 0.3, random);
      constexpr int kIterations = 20;
      const std::vector<double> expected = TextbookBoundTrace(pair.dense, kIterations + 1);
      const TrwsResult result = RunTrws(pair.problem, {kIterations, 0.0F});
      ASSERT_LE(result.bound_trace.size(), expected.size());
      for (size_t i = 0; i < result.bound_trace.size(); ++i) {
        EXPECT_NEAR(result.bound_trace[i], expected[i], 1e-4) << columns << "x" << rows << " iteration " << i;
      }
      EXPECT_NEAR(result.lower_bound, expected.back(), 1e-4);
    }
  }
}

TEST(Trws, BoundDoesNotDecreaseAndSkippingKeepsItValid) {
  std::mt19937 random(12);
  for (int trial = 0; trial < 20; ++trial) {
    Pair pair = MakeRandomPair(20, 20, 4, 0.4, random);
    TrwsProblem lazy = pair.problem;
    const TrwsResult exact = RunTrws(pair.problem, {60, 0.0F});
    for (size_t i = 1; i < exact.bound_trace.size(); ++i) {
      EXPECT_GE(exact.bound_trace[i], exact.bound_trace[i - 1] - 1e-4);
    }
    EXPECT_GE(exact.lower_bound, exact.bound_trace.back() - 1e-4);
    const TrwsResult skipping = RunTrws(lazy, {60, 5e-3F});
    EXPECT_NEAR(skipping.lower_bound, exact.lower_bound, 1e-3 * 400);
    // The bound is that of the messages at hand: a run with no more iterations to do finds the same.
    EXPECT_NEAR(RunTrws(lazy, {0, 0.0F}).lower_bound, skipping.lower_bound, 1e-4);
  }
}

TEST(Trws, EnergyOfALabellingIsThatOfTheDenseFormWhateverTheMessages) {
  std::mt19937 random(13);
  Pair pair = MakeRandomPair(9, 9, 3, 0.0, random);
  RunTrws(pair.problem, {3, 0.0F});
  const TrwsProblem& problem = pair.problem;
  for (int trial = 0; trial < 20; ++trial) {
    std::vector<uint8_t> labels(problem.node_count());
    for (int s = 0; s < problem.node_count(); ++s) labels[s] = random() % (problem.node(s).patch_count + 1);
    EXPECT_NEAR(LabellingEnergy(problem, labels), DenseCost(pair.dense, labels), 1e-4);
  }
}

TEST(Trws, ChainsAreSolvedExactly) {
  std::mt19937 random(14);
  for (int trial = 0; trial < 50; ++trial) {
    const bool horizontal = trial % 2 == 0;
    Pair pair = MakeRandomPair(horizontal ? 60 : 1, horizontal ? 1 : 60, 4, 0.3, random);
    const TrwsResult result = RunTrws(pair.problem, {5, 0.0F});
    const std::vector<uint8_t> labels = DecodeLabels(pair.problem, /*reversed=*/false);
    EXPECT_NEAR(DenseCost(pair.dense, labels), result.lower_bound, 1e-4);
    EXPECT_NEAR(DenseCost(pair.dense, DecodeLabels(pair.problem, /*reversed=*/true)), result.lower_bound, 1e-4);
  }
}

TEST(Trws, PolishingNeverRaisesTheEnergyAndEndsInALocalMinimum) {
  std::mt19937 random(15);
  Pair pair = MakeRandomPair(15, 15, 3, 0.4, random);
  std::vector<uint8_t> labels(pair.problem.node_count(), 0);
  RunIcm(pair.problem, labels);
  const double energy = LabellingEnergy(pair.problem, labels);
  EXPECT_LE(energy, 0.0);
  for (int s = 0; s < pair.problem.node_count(); ++s) {
    for (int label = 0; label <= pair.problem.node(s).patch_count; ++label) {
      std::vector<uint8_t> other = labels;
      other[s] = static_cast<uint8_t>(label);
      EXPECT_GE(LabellingEnergy(pair.problem, other), energy - 1e-5);
    }
  }
}

TEST(Trws, ConstantsOnSidesWithoutAnEdgeCount) {
  TrwsProblem problem;
  problem.AddNode(2)[0] = -1.0F;
  problem.Incoming(0, kUp)[0] = std::numeric_limits<float>::infinity();
  problem.Incoming(0, kDown)[1] = -0.25F;
  EXPECT_FLOAT_EQ(RunTrws(problem, {10, 0.0F}).lower_bound, -0.25);
  const std::vector<uint8_t> labels = DecodeLabels(problem, false);
  EXPECT_THAT(labels, testing::ElementsAre(2));
  EXPECT_FLOAT_EQ(LabellingEnergy(problem, labels), -0.25);
}

TEST(Trws, EmptyProblem) {
  TrwsProblem problem;
  EXPECT_EQ(RunTrws(problem, {10, 0.0F}).lower_bound, 0.0);
  EXPECT_TRUE(DecodeLabels(problem, false).empty());
}

}  // namespace
}  // namespace meshwright
