// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <vector>

namespace meshwright {

// Where a neighbour lies. Raster order visits left and up neighbours before a node, right and down ones after it.
enum Side : int { kLeft = 0, kUp = 1, kRight = 2, kDown = 3 };
inline constexpr Side OppositeSide(Side side) { return static_cast<Side>(side ^ 2); }

// The part of a grid energy that has a choice: nodes with patches, in raster order, and the edges between them, written
// relative to label 0 ("nothing here"):
//
//   E(x) = sum_s u_s(x_s) + sum_{st} phi_st(x_s, x_t),   u_s(0) = 0,   phi_st(0, .) = phi_st(., 0) = 0,
//
// up to a constant. Any pairwise energy can be written so. For the paper's (theta(0,i) = theta(i,0) = e0) it means
// phi(i,j) = theta(i,j) - 2 e0 and one e0 per grid neighbour in u(i): neighbours that can only be 0 need no edge at
// all.
//
// A message M into a node is relative to its value for label 0 too, so a node with a single patch gets one float.
class TrwsProblem {
 public:
  struct Node {
    int32_t block = 0;  // costs() of this node: unary, then the messages from each Side, patch_count floats each
    std::array<int32_t, 4> neighbour = {-1, -1, -1, -1};  // positions in nodes(), -1: no edge on that Side
    int32_t right_table = 0;                              // phi(i, j) of the edge to the right at tables()[i * n_t + j]
    int32_t down_table = 0;
    int32_t patch_count = 0;  // > 0
  };

  // Nodes come in raster order. The returned costs are those of patches 1..patch_count, all zero.
  float* AddNode(int patch_count);
  // Joins s to a later node, its right or down neighbour; the returned table (patch_count(s) rows, patch_count(t)
  // columns, row-major) is to be filled before the next call.
  float* AddEdge(int s, Side side, int t);

  int node_count() const { return static_cast<int>(nodes_.size()); }
  const Node& node(int s) const { return nodes_[s]; }
  const float* Unary(int s) const { return &costs_[nodes_[s].block]; }
  // What is added to the node's costs from that side: the message along the edge, or, on a side without an edge, a
  // constant that the caller may set (the cost of a neighbour whose label is fixed, +infinity allowed).
  float* Incoming(int s, Side side) { return &costs_[nodes_[s].block + (1 + side) * nodes_[s].patch_count]; }
  const float* Incoming(int s, Side side) const {
    return &costs_[nodes_[s].block + (1 + side) * nodes_[s].patch_count];
  }
  const float* Table(int s, Side side) const {
    return &tables_[side == kRight ? nodes_[s].right_table : nodes_[s].down_table];
  }
  // Cuts s off from its neighbour on that side; the message that last came from there stays as a constant.
  void CutEdge(int s, Side side) { nodes_[s].neighbour[side] = -1; }

 private:
  std::vector<Node> nodes_;
  std::vector<float> costs_;
  std::vector<float> tables_;
};

struct TrwsStopping {
  int max_iterations = 50;         // an iteration is a forward and a backward pass
  float message_tolerance = 0.0F;  // cost: a message that would change by no more is left as it is
};

struct TrwsResult {
  double lower_bound = 0.0;  // of the energy of the problem's active nodes
  int iterations = 0;
  std::vector<double> bound_trace;  // after each iteration's forward pass; exact when message_tolerance is 0
};

// Sequential tree-reweighted message passing, TRW-S (Kolmogorov, "Convergent tree-reweighted message passing for energy
// minimization", PAMI 2006), with the nodes in raster order.
//
// The energy is split into monotonic chains, at each node s as many as pass through it: n_s = max(edges to earlier
// nodes, edges to later nodes), each with the share 1/n_s of the node's costs. The lower bound is the sum of the
// chains' minima. With c_s = u_s + everything incoming, the forward pass visits nodes in order and replaces, for every
// later neighbour t,
//
//   M_st(k) = min_j [ c_s(j) / n_s - M_ts(j) + phi_st(j, k) ]  -  delta_st,   delta_st = the same minimum for k = 0;
//
// the backward pass does the same in the reversed order. Messages are a reparametrisation: they move costs between
// nodes and edges and leave E as it is. After a forward pass
//
//   bound = sum_st delta_st + sum_s (1 - later_s / n_s) min_j c_s(j)        (the second sum: chains that end at s)
//
// whatever the backward messages were, and no pass lowers it. It equals the smallest energy when the edges form chains,
// and, at convergence, when the energy is submodular.
//
// What is ours: a node is visited again only when a message into it has changed by more than message_tolerance; smaller
// changes are not stored, so that they add up until they count. With a tolerance of 0 every message is the textbook
// algorithm's. It ends when no node is left to visit, or after
// max_iterations. The last forward pass visits all nodes and stores all messages: the bound returned is exact for any
// tolerance, but for the rounding of floats.
//
// active: one flag per node, empty for all; there must be no edge between active and other nodes, which are left alone.
// Messages are kept in the problem: a second run goes on from them.
TrwsResult RunTrws(TrwsProblem& problem, const TrwsStopping& stopping, const std::vector<uint8_t>& active = {});

// Labels in raster order, each the best given the labels of earlier neighbours and the messages from later ones
// (Kolmogorov 2006, "choosing a solution"); with `reversed` the other way round. The smaller of equals.
std::vector<uint8_t> DecodeLabels(const TrwsProblem& problem, bool reversed);

// Changes single labels while that lowers the energy (iterated conditional modes).
void RunIcm(const TrwsProblem& problem, std::vector<uint8_t>& labels);

double LabellingEnergy(const TrwsProblem& problem, const std::vector<uint8_t>& labels);

}  // namespace meshwright
