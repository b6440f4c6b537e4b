// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace meshwright {

// A Markov random field over any graph, each node with candidates of its own: the sum of the costs of the chosen
// candidates and of `different_cost` for each edge between different labels (Potts) is to be small.
struct LabelProblem {
  std::vector<int32_t> first;                 // of node i: candidates first[i] .. first[i + 1] - 1; may be none
  std::vector<int32_t> labels;                // of a candidate; ascending in a node
  std::vector<float> costs;                   // of a candidate
  std::vector<std::array<int32_t, 2>> edges;  // nodes, the smaller number first
  float different_cost = 0;

  size_t nodes() const { return first.size() - 1; }
};

constexpr int32_t kNoLabel = -1;

struct LabelSolution {
  std::vector<int32_t> labels;  // of nodes; kNoLabel for those without candidates, whose edges cost nothing
  double energy = 0;
};

// Sequential tree-reweighted message passing (Kolmogorov 2006), nodes in the order of their numbers, then iterated
// conditional modes from the best labelling seen. Depends on the problem alone.
LabelSolution SolveLabels(const LabelProblem& problem, int max_iterations);

}  // namespace meshwright
