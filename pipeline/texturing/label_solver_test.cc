// SPDX-License-Identifier: Apache-2.0
#include "pipeline/texturing/label_solver.h"

#include <limits>
#include <random>

#include <gtest/gtest.h>

namespace meshwright {
namespace {

LabelProblem RandomProblem(std::mt19937& random, int nodes, bool is_tree) {
  LabelProblem problem;
  problem.different_cost = 0.4F;
  problem.first.push_back(0);
  for (int i = 0; i < nodes; ++i) {
    for (int32_t label = 0; label < 4; ++label) {
      if (random() % 3 == 0) continue;
      problem.labels.push_back(label);
      problem.costs.push_back(static_cast<float>(random() % 1000) / 1000);
    }
    problem.first.push_back(static_cast<int32_t>(problem.labels.size()));
    if (i > 0) problem.edges.push_back({static_cast<int32_t>(random() % static_cast<unsigned>(i)), i});
    if (i > 2 && !is_tree) problem.edges.push_back({i - 2, i});
  }
  return problem;
}

double EnergyOf(const LabelProblem& problem, const std::vector<int32_t>& labels) {
  double energy = 0;
  for (size_t i = 0; i < problem.nodes(); ++i) {
    for (int32_t c = problem.first[i]; c < problem.first[i + 1]; ++c) {
      if (problem.labels[static_cast<size_t>(c)] == labels[i]) energy += problem.costs[static_cast<size_t>(c)];
    }
  }
  for (const auto& [a, b] : problem.edges) {
    const int32_t at_a = labels[static_cast<size_t>(a)];
    const int32_t at_b = labels[static_cast<size_t>(b)];
    if (at_a != kNoLabel && at_b != kNoLabel && at_a != at_b) energy += problem.different_cost;
  }
  return energy;
}

// By trying everything.
double LeastEnergy(const LabelProblem& problem, std::vector<int32_t>& labels, size_t node) {
  if (node == problem.nodes()) return EnergyOf(problem, labels);
  double least = std::numeric_limits<double>::infinity();
  labels[node] = kNoLabel;
  if (problem.first[node] == problem.first[node + 1]) return LeastEnergy(problem, labels, node + 1);
  for (int32_t c = problem.first[node]; c < problem.first[node + 1]; ++c) {
    labels[node] = problem.labels[static_cast<size_t>(c)];
    least = std::min(least, LeastEnergy(problem, labels, node + 1));
  }
  return least;
}

TEST(LabelSolverTest, IsExactOnTrees) {
  std::mt19937 random(7);
  for (int i = 0; i < 30; ++i) {
    const LabelProblem problem = RandomProblem(random, 7, true);
    std::vector<int32_t> labels(problem.nodes());
    EXPECT_NEAR(SolveLabels(problem, 50).energy, LeastEnergy(problem, labels, 0), 1e-5);
  }
}

TEST(LabelSolverTest, TellsTheEnergyOfItsLabelsAndComesNearTheLeast) {
  std::mt19937 random(8);
  double found = 0;
  double least = 0;
  for (int i = 0; i < 30; ++i) {
    const LabelProblem problem = RandomProblem(random, 8, false);
    const LabelSolution solution = SolveLabels(problem, 50);
    EXPECT_NEAR(solution.energy, EnergyOf(problem, solution.labels), 1e-5);
    std::vector<int32_t> labels(problem.nodes());
    found += solution.energy;
    least += LeastEnergy(problem, labels, 0);
  }
  EXPECT_LE(found, 1.02 * least);
}

TEST(LabelSolverTest, NodesWithoutCandidatesHaveNoLabel) {
  LabelProblem problem;
  problem.first = {0, 0, 1};
  problem.labels = {5};
  problem.costs = {0.25F};
  problem.edges = {{0, 1}};
  problem.different_cost = 1;
  const LabelSolution solution = SolveLabels(problem, 5);
  EXPECT_EQ(solution.labels, (std::vector<int32_t>{kNoLabel, 5}));
  EXPECT_DOUBLE_EQ(solution.energy, 0.25);
}

}  // namespace
}  // namespace meshwright
