// SPDX-License-Identifier: Apache-2.0
#include "pipeline/texturing/label_solver.h"

#include <algorithm>
#include <cstddef>
#include <limits>
#include <utility>

namespace meshwright {
namespace {

constexpr int kPatience = 6;  // iterations without a better labelling
constexpr int kMaxIcmRounds = 20;
constexpr int32_t kNoCandidate = -1;

class Trws {
 public:
  explicit Trws(const LabelProblem& problem) : problem_(problem), incident_first_(problem.nodes() + 1, 0) {
    size_t messages = 0;
    for (const auto& edge : problem.edges) {
      for (const int32_t node : edge) {
        ++incident_first_[static_cast<size_t>(node) + 1];
        message_first_.push_back(messages);
        messages += Candidates(node);
      }
    }
    messages_.assign(messages, 0.0F);
    for (size_t i = 0; i < problem.nodes(); ++i) incident_first_[i + 1] += incident_first_[i];
    incident_.resize(2 * problem.edges.size());
    std::vector<size_t> next(incident_first_.begin(), incident_first_.end() - 1);
    for (size_t e = 0; e < problem.edges.size(); ++e) {
      for (const int32_t node : problem.edges[e]) incident_[next[static_cast<size_t>(node)]++] = e;
    }
  }

  // Candidates chosen, by number; kNoCandidate where there are none.
  std::pair<std::vector<int32_t>, double> Solve(int max_iterations) {
    std::vector<int32_t> best;
    double best_energy = std::numeric_limits<double>::infinity();
    int since_better = 0;
    for (int i = 0; i < max_iterations && since_better < kPatience; ++i) {
      Pass(true);
      Pass(false);
      std::vector<int32_t> chosen = Choose();
      const double energy = Energy(chosen);
      ++since_better;
      if (energy >= best_energy) continue;
      since_better = 0;
      best = std::move(chosen);
      best_energy = energy;
    }
    if (best.empty()) best = Choose();
    RunIcm(best);
    return {best, Energy(best)};
  }

 private:
  size_t First(int32_t node) const { return static_cast<size_t>(problem_.first[static_cast<size_t>(node)]); }
  size_t Candidates(int32_t node) const { return First(node + 1) - First(node); }
  size_t IncidentBegin(int32_t node) const { return incident_first_[static_cast<size_t>(node)]; }
  size_t IncidentEnd(int32_t node) const { return incident_first_[static_cast<size_t>(node) + 1]; }
  int32_t Other(size_t edge, int32_t node) const {
    const auto& [a, b] = problem_.edges[edge];
    return a == node ? b : a;
  }
  // Message along `edge` that arrives at `node`: one value for each of its candidates.
  float* Message(size_t edge, int32_t node) {
    return &messages_[message_first_[2 * edge + (problem_.edges[edge][1] == node ? 1 : 0)]];
  }

  // Cost of each candidate with all that arrives.
  void Gather(int32_t node, std::vector<float>& costs) {
    const auto first = problem_.costs.begin() + static_cast<std::ptrdiff_t>(First(node));
    costs.assign(first, first + static_cast<std::ptrdiff_t>(Candidates(node)));
    for (size_t i = IncidentBegin(node); i < IncidentEnd(node); ++i) {
      const float* const message = Message(incident_[i], node);
      for (size_t k = 0; k < costs.size(); ++k) costs[k] += message[k];
    }
  }

  void Send(size_t edge, int32_t from, int32_t to, const std::vector<float>& costs, float share) {
    const float* const back = Message(edge, from);
    float* const out = Message(edge, to);
    float least = std::numeric_limits<float>::infinity();
    for (size_t k = 0; k < costs.size(); ++k) least = std::min(least, share * costs[k] - back[k]);
    float least_out = std::numeric_limits<float>::infinity();
    size_t k = 0;
    for (size_t j = 0; j < Candidates(to); ++j) {
      const int32_t label = problem_.labels[First(to) + j];
      while (k < costs.size() && problem_.labels[First(from) + k] < label) ++k;
      out[j] = least + problem_.different_cost;
      if (k < costs.size() && problem_.labels[First(from) + k] == label) {
        out[j] = std::min(out[j], share * costs[k] - back[k]);
      }
      least_out = std::min(least_out, out[j]);
    }
    for (size_t j = 0; j < Candidates(to); ++j) out[j] -= least_out;
  }

  void Pass(bool forward) {
    const auto nodes = static_cast<int32_t>(problem_.nodes());
    std::vector<float> costs;
    for (int32_t i = 0; i < nodes; ++i) {
      const int32_t node = forward ? i : nodes - 1 - i;
      if (Candidates(node) == 0) continue;
      int later = 0;
      int earlier = 0;
      for (size_t e = IncidentBegin(node); e < IncidentEnd(node); ++e) {
        const int32_t other = Other(incident_[e], node);
        if (Candidates(other) > 0) ++((other > node) == forward ? later : earlier);
      }
      if (later == 0) continue;
      Gather(node, costs);
      const float share = 1.0F / static_cast<float>(std::max(later, earlier));
      for (size_t e = IncidentBegin(node); e < IncidentEnd(node); ++e) {
        const int32_t other = Other(incident_[e], node);
        if (Candidates(other) > 0 && (other > node) == forward) Send(incident_[e], node, other, costs, share);
      }
    }
  }

  bool Agree(int32_t node, size_t candidate, int32_t other_candidate) const {
    return problem_.labels[First(node) + candidate] == problem_.labels[static_cast<size_t>(other_candidate)];
  }

  // Nodes in order, each the best with the choices before it and the messages from those behind it.
  std::vector<int32_t> Choose() {
    std::vector<int32_t> chosen(problem_.nodes(), kNoCandidate);
    std::vector<float> costs;
    for (int32_t node = 0; node < static_cast<int32_t>(problem_.nodes()); ++node) {
      if (Candidates(node) == 0) continue;
      const auto first = problem_.costs.begin() + static_cast<std::ptrdiff_t>(First(node));
      costs.assign(first, first + static_cast<std::ptrdiff_t>(Candidates(node)));
      for (size_t e = IncidentBegin(node); e < IncidentEnd(node); ++e) {
        const int32_t other = Other(incident_[e], node);
        const float* const message = Message(incident_[e], node);
        const int32_t there = chosen[static_cast<size_t>(other)];
        for (size_t k = 0; k < costs.size(); ++k) {
          if (other > node) {
            costs[k] += message[k];
          } else if (there != kNoCandidate && !Agree(node, k, there)) {
            costs[k] += problem_.different_cost;
          }
        }
      }
      const auto best = std::min_element(costs.begin(), costs.end()) - costs.begin();
      chosen[static_cast<size_t>(node)] = static_cast<int32_t>(First(node)) + static_cast<int32_t>(best);
    }
    return chosen;
  }

  void RunIcm(std::vector<int32_t>& chosen) {
    for (int round = 0; round < kMaxIcmRounds; ++round) {
      bool changed = false;
      for (int32_t node = 0; node < static_cast<int32_t>(problem_.nodes()); ++node) {
        if (Candidates(node) == 0) continue;
        int32_t best = chosen[static_cast<size_t>(node)];
        float best_cost = CostOf(node, best, chosen);
        for (auto c = static_cast<int32_t>(First(node)); c < static_cast<int32_t>(First(node + 1)); ++c) {
          const float cost = CostOf(node, c, chosen);
          if (cost >= best_cost) continue;
          best = c;
          best_cost = cost;
        }
        changed |= best != chosen[static_cast<size_t>(node)];
        chosen[static_cast<size_t>(node)] = best;
      }
      if (!changed) return;
    }
  }

  float CostOf(int32_t node, int32_t candidate, const std::vector<int32_t>& chosen) const {
    float cost = problem_.costs[static_cast<size_t>(candidate)];
    for (size_t e = IncidentBegin(node); e < IncidentEnd(node); ++e) {
      const int32_t there = chosen[static_cast<size_t>(Other(incident_[e], node))];
      if (there == kNoCandidate) continue;
      const bool same = problem_.labels[static_cast<size_t>(candidate)] == problem_.labels[static_cast<size_t>(there)];
      if (!same) cost += problem_.different_cost;
    }
    return cost;
  }

  double Energy(const std::vector<int32_t>& chosen) const {
    double energy = 0;
    for (const int32_t candidate : chosen) {
      if (candidate != kNoCandidate) energy += problem_.costs[static_cast<size_t>(candidate)];
    }
    for (const auto& [a, b] : problem_.edges) {
      const int32_t at_a = chosen[static_cast<size_t>(a)];
      const int32_t at_b = chosen[static_cast<size_t>(b)];
      if (at_a == kNoCandidate || at_b == kNoCandidate) continue;
      const bool same = problem_.labels[static_cast<size_t>(at_a)] == problem_.labels[static_cast<size_t>(at_b)];
      if (!same) energy += problem_.different_cost;
    }
    return energy;
  }

  const LabelProblem& problem_;
  std::vector<size_t> incident_first_;  // of node i: incident_[incident_first_[i]] .. incident_[incident_first_[i + 1]]
  std::vector<size_t> incident_;        // edges
  std::vector<size_t> message_first_;   // two an edge: to its first and to its second node
  std::vector<float> messages_;
};

}  // namespace

LabelSolution SolveLabels(const LabelProblem& problem, int max_iterations) {
  auto [chosen, energy] = Trws(problem).Solve(max_iterations);
  LabelSolution solution;
  solution.energy = energy;
  for (const int32_t candidate : chosen) {
    solution.labels.push_back(candidate == kNoCandidate ? kNoLabel : problem.labels[static_cast<size_t>(candidate)]);
  }
  return solution;
}

}  // namespace meshwright
