// SPDX-License-Identifier: Apache-2.0
#include "worker/mrf/trws.h"

#include <algorithm>
#include <cmath>

#include <absl/types/span.h>

#include "common/base/check.h"

namespace meshwright {
namespace {

constexpr int kMaxPatches = 254;
constexpr uint8_t kForwardDue = 1;
constexpr uint8_t kBackwardDue = 2;

// 1 / n_s: one chain passes from left to right, another from top to bottom; where a node has an earlier neighbour on
// one line and a later one on the other only, they are the same chain.
float ChainShare(const TrwsProblem::Node& node) {
  const bool two_earlier = node.neighbour[kLeft] >= 0 && node.neighbour[kUp] >= 0;
  const bool two_later = node.neighbour[kRight] >= 0 && node.neighbour[kDown] >= 0;
  return two_earlier || two_later ? 0.5F : 1.0F;
}

// Sends the messages of one node in one direction.
template <bool kForward>
class Sender {
 public:
  Sender(TrwsProblem& problem, float tolerance, std::vector<uint8_t>& due)
      : problem_(problem), tolerance_(tolerance), due_(due) {}

  // Returns the node's part of the lower bound.
  float Send(int s) {
    constexpr Side kSides[2] = {kForward ? kRight : kLeft, kForward ? kDown : kUp};
    const TrwsProblem::Node& node = problem_.node(s);
    const int count = node.patch_count;
    const float share = ChainShare(node);
    const float* block = problem_.Unary(s);
    float smallest = 0.0F;
    float costs[kMaxPatches];
    for (int j = 0; j < count; ++j) {
      const float* cost_parts = block + j;
      const float cost = cost_parts[0] + ((cost_parts[count] + cost_parts[2 * count]) +
                                          (cost_parts[3 * count] + cost_parts[4 * count]));
      costs[j] = cost;
      smallest = std::min(smallest, cost);
    }
    float bound = 0.0F;
    float ending = 1.0F;
    for (const Side side : kSides) {
      const int t = node.neighbour[side];
      if (t < 0) continue;
      ending -= share;
      bound += SendTo(s, side, t, absl::MakeConstSpan(costs, count), share);
    }
    return bound + ending * smallest;
  }

 private:
  float SendTo(int s, Side side, int t, absl::Span<const float> costs, float share) {
    const int count = static_cast<int>(costs.size());
    const int target_count = problem_.node(t).patch_count;
    const float* back = problem_.Incoming(s, side);
    float* message = problem_.Incoming(t, OppositeSide(side));
    const float* table = kForward ? problem_.Table(s, side) : problem_.Table(t, OppositeSide(side));
    const int stride_j = kForward ? target_count : 1;
    const int stride_k = kForward ? 1 : count;
    float rest[kMaxPatches];
    float delta = 0.0F;
    for (int j = 0; j < count; ++j) {
      rest[j] = share * costs[j] - back[j];
      delta = std::min(delta, rest[j]);
    }
    bool changed = false;
    for (int k = 0; k < target_count; ++k) {
      float best = 0.0F;
      for (int j = 0; j < count; ++j) best = std::min(best, rest[j] + table[j * stride_j + k * stride_k]);
      best -= delta;
      if (std::abs(best - message[k]) > tolerance_) {
        message[k] = best;
        changed = true;
      }
    }
    if (changed) due_[t] = kForwardDue | kBackwardDue;
    return delta;
  }

  TrwsProblem& problem_;
  const float tolerance_;
  std::vector<uint8_t>& due_;
};

// Cost of the node's patches given labels of the neighbours for which use_label(side), messages or constants from the
// other sides.
template <typename UseLabel>
void ConditionalCosts(const TrwsProblem& problem, int s, const std::vector<uint8_t>& labels, UseLabel use_label,
                      float* costs) {
  const TrwsProblem::Node& node = problem.node(s);
  const int count = node.patch_count;
  std::copy_n(problem.Unary(s), count, costs);
  for (const Side side : {kLeft, kUp, kRight, kDown}) {
    const int t = node.neighbour[side];
    if (t < 0 || !use_label(side)) {
      const float* incoming = problem.Incoming(s, side);
      for (int j = 0; j < count; ++j) costs[j] += incoming[j];
    } else if (labels[t] > 0) {
      const bool later = side == kRight || side == kDown;
      const float* table = later ? problem.Table(s, side) : problem.Table(t, OppositeSide(side));
      const int stride = later ? problem.node(t).patch_count : 1;
      table += later ? labels[t] - 1 : (labels[t] - 1) * count;
      for (int j = 0; j < count; ++j) costs[j] += table[j * stride];
    }
  }
}

uint8_t BestLabel(const float* costs, int count) {
  int best = 0;
  float best_cost = 0.0F;
  for (int j = 0; j < count; ++j) {
    if (costs[j] < best_cost) {
      best_cost = costs[j];
      best = j + 1;
    }
  }
  return static_cast<uint8_t>(best);
}

}  // namespace

float* TrwsProblem::AddNode(int patch_count) {
  MW_CHECK(patch_count > 0 && patch_count <= kMaxPatches);
  Node node;
  node.block = static_cast<int32_t>(costs_.size());
  node.patch_count = patch_count;
  nodes_.push_back(node);
  costs_.resize(costs_.size() + 5 * static_cast<size_t>(patch_count), 0.0F);
  return &costs_[node.block];
}

float* TrwsProblem::AddEdge(int s, Side side, int t) {
  MW_CHECK((side == kRight || side == kDown) && s < t);
  nodes_[s].neighbour[side] = t;
  nodes_[t].neighbour[OppositeSide(side)] = s;
  const size_t begin = tables_.size();
  (side == kRight ? nodes_[s].right_table : nodes_[s].down_table) = static_cast<int32_t>(begin);
  tables_.resize(begin + static_cast<size_t>(nodes_[s].patch_count) * nodes_[t].patch_count);
  return &tables_[begin];
}

TrwsResult RunTrws(TrwsProblem& problem, const TrwsStopping& stopping, const std::vector<uint8_t>& active) {
  const int count = problem.node_count();
  MW_CHECK(active.empty() || static_cast<int>(active.size()) == count);
  std::vector<uint8_t> due(count, kForwardDue | kBackwardDue);
  for (int s = 0; s < static_cast<int>(active.size()); ++s) {
    if (active[s] == 0) due[s] = 0;
  }
  Sender<true> forward(problem, stopping.message_tolerance, due);
  Sender<false> backward(problem, stopping.message_tolerance, due);
  std::vector<float> part(count, 0.0F);  // of the lower bound, as last computed by the forward pass
  double bound = 0.0;
  TrwsResult result;
  bool idle = false;
  while (!idle && result.iterations < stopping.max_iterations) {
    idle = true;
    for (int s = 0; s < count; ++s) {
      if ((due[s] & kForwardDue) == 0) continue;
      due[s] &= ~kForwardDue;
      idle = false;
      bound -= part[s];
      part[s] = forward.Send(s);
      bound += part[s];
    }
    result.bound_trace.push_back(bound);
    for (int s = count - 1; s >= 0; --s) {
      if ((due[s] & kBackwardDue) == 0) continue;
      due[s] &= ~kBackwardDue;
      idle = false;
      backward.Send(s);
    }
    ++result.iterations;
  }
  Sender<true> exact(problem, -1.0F, due);
  for (int s = 0; s < count; ++s) {
    if (active.empty() || active[s] != 0) result.lower_bound += exact.Send(s);
  }
  return result;
}

std::vector<uint8_t> DecodeLabels(const TrwsProblem& problem, bool reversed) {
  const int count = problem.node_count();
  std::vector<uint8_t> labels(count, 0);
  float costs[kMaxPatches];
  for (int i = 0; i < count; ++i) {
    const int s = reversed ? count - 1 - i : i;
    ConditionalCosts(
        problem, s, labels, [reversed](Side side) { return (side == kRight || side == kDown) == reversed; }, costs);
    labels[s] = BestLabel(costs, problem.node(s).patch_count);
  }
  return labels;
}

void RunIcm(const TrwsProblem& problem, std::vector<uint8_t>& labels) {
  constexpr int kMaxSweeps = 10;
  float costs[kMaxPatches];
  bool changed = true;
  for (int sweep = 0; sweep < kMaxSweeps && changed; ++sweep) {
    changed = false;
    for (int s = 0; s < problem.node_count(); ++s) {
      ConditionalCosts(
          problem, s, labels, [](Side) { return true; }, costs);
      const uint8_t best = BestLabel(costs, problem.node(s).patch_count);
      const float best_cost = best == 0 ? 0.0F : costs[best - 1];
      const float cost = labels[s] == 0 ? 0.0F : costs[labels[s] - 1];
      if (best_cost < cost) {
        labels[s] = best;
        changed = true;
      }
    }
  }
}

double LabellingEnergy(const TrwsProblem& problem, const std::vector<uint8_t>& labels) {
  double energy = 0.0;
  for (int s = 0; s < problem.node_count(); ++s) {
    if (labels[s] == 0) continue;
    const TrwsProblem::Node& node = problem.node(s);
    energy += problem.Unary(s)[labels[s] - 1];
    for (const Side side : {kLeft, kUp, kRight, kDown}) {
      const int t = node.neighbour[side];
      if (t < 0) {
        energy += problem.Incoming(s, side)[labels[s] - 1];
      } else if ((side == kRight || side == kDown) && labels[t] > 0) {
        energy += problem.Table(s, side)[(labels[s] - 1) * problem.node(t).patch_count + labels[t] - 1];
      }
    }
  }
  return energy;
}

}  // namespace meshwright
