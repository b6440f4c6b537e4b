// SPDX-License-Identifier: Apache-2.0
#include "worker/mrf/window.h"

#include <algorithm>
#include <array>

#include "common/base/check.h"

namespace meshwright {
namespace {

constexpr std::array<Side, 4> kSides = {kLeft, kUp, kRight, kDown};
constexpr std::array<int, 4> kColumnStep = {-1, 0, 1, 0};
constexpr std::array<int, 4> kRowStep = {0, -1, 0, 1};

// Iterations for the lower bound's sake, after the labels are known: they only have to repair what changes at the
// window's border.
constexpr int kBoundIterations = 5;

// The undecided nodes of B as a TRW-S problem. theta is rewritten relative to label 0: with e0 the boundary cost,
// u(i) = theta(i) - theta(0) + e0 * (neighbours) and phi(i, j) = theta(i, j) - 2 e0.
class Window {
 public:
  Window(const GridMrf& mrf, const NodeRect& window, const NodeRect& grown, const std::vector<uint8_t>& labels)
      : mrf_(mrf), window_(window), grown_(grown) {
    const int width = grown.column_end - grown.column_begin;
    std::vector<int> row_above(width, -1);
    for (int row = grown.row_begin; row < grown.row_end; ++row) {
      int left = -1;
      for (int column = grown.column_begin; column < grown.column_end; ++column) {
        const int grid_node = row * mrf.columns + column;
        int& above = row_above[column - grown.column_begin];
        if (labels[grid_node] != kUndecided) {
          left = above = -1;
          continue;
        }
        const int s = AddNode(column, row, labels);
        if (left >= 0) AddEdge(left, kRight, s);
        if (above >= 0) AddEdge(above, kDown, s);
        left = above = s;
      }
    }
  }

  TrwsProblem& problem() { return problem_; }
  int node_count() const { return static_cast<int>(grid_node_.size()); }
  int grid_node(int s) const { return grid_node_[s]; }
  int column(int s) const { return grid_node_[s] % mrf_.columns; }
  int row(int s) const { return grid_node_[s] / mrf_.columns; }
  bool InWindow(int s) const { return window_.Contains(column(s), row(s)); }

  // True when the neighbour on that side has patches and lies in another window.
  bool HasSeam(int s, Side side) const {
    const int other_column = column(s) + kColumnStep[side];
    const int other_row = row(s) + kRowStep[side];
    if (window_.Contains(other_column, other_row)) return false;
    if (other_column < 0 || other_column >= mrf_.columns || other_row < 0 || other_row >= mrf_.rows) return false;
    return mrf_.PatchCount(other_row * mrf_.columns + other_column) > 0;
  }

 private:
  int AddNode(int column, int row, const std::vector<uint8_t>& labels) {
    const int grid_node = row * mrf_.columns + column;
    const int patch_count = mrf_.PatchCount(grid_node);
    const int32_t first_patch = mrf_.first_patch[grid_node];
    float* unary = problem_.AddNode(patch_count);
    const int s = node_count();
    grid_node_.push_back(grid_node);
    float boundary = 0.0F;
    for (const Side side : kSides) {
      const int other_column = column + kColumnStep[side];
      const int other_row = row + kRowStep[side];
      if (other_column < 0 || other_column >= mrf_.columns || other_row < 0 || other_row >= mrf_.rows) continue;
      const int other = other_row * mrf_.columns + other_column;
      if (labels[other] == kUndecided && !grown_.Contains(other_column, other_row)) continue;
      boundary += mrf_.boundary_cost;
      if (labels[other] == kUndecided || labels[other] == 0) continue;
      float* condition = problem_.Incoming(s, side);
      const int32_t other_patch = mrf_.first_patch[other] + labels[other] - 1;
      for (int j = 0; j < patch_count; ++j) {
        condition[j] =
            side == kLeft || side == kUp ? Phi(other_patch, first_patch + j) : Phi(first_patch + j, other_patch);
      }
    }
    for (int j = 0; j < patch_count; ++j) unary[j] = mrf_.patch_cost[first_patch + j] - mrf_.label0_cost + boundary;
    return s;
  }

  void AddEdge(int s, Side side, int t) {
    float* table = problem_.AddEdge(s, side, t);
    const int32_t begin_s = mrf_.first_patch[grid_node_[s]];
    const int32_t begin_t = mrf_.first_patch[grid_node_[t]];
    const int count_t = problem_.node(t).patch_count;
    for (int i = 0; i < problem_.node(s).patch_count; ++i) {
      for (int j = 0; j < count_t; ++j) table[i * count_t + j] = Phi(begin_s + i, begin_t + j);
    }
  }

  float Phi(int32_t patch_s, int32_t patch_t) const {
    return mrf_.pairwise(patch_s, patch_t) - 2.0F * mrf_.boundary_cost;
  }

  const GridMrf& mrf_;
  const NodeRect window_;
  const NodeRect grown_;
  TrwsProblem problem_;
  std::vector<int> grid_node_;
};

// Best of the labellings that the messages suggest; never worse than all zero.
std::vector<uint8_t> BestLabelling(const TrwsProblem& problem) {
  std::vector<uint8_t> best(problem.node_count(), 0);
  double best_energy = 0.0;
  for (const bool reversed : {false, true}) {
    std::vector<uint8_t> labels = DecodeLabels(problem, reversed);
    RunIcm(problem, labels);
    const double energy = LabellingEnergy(problem, labels);
    if (energy < best_energy) {
      best_energy = energy;
      best = std::move(labels);
    }
  }
  return best;
}

// Splits the cost of the edge from s to its neighbour t: s keeps the message from t, t gets the most that is left of
// the cost then, rest + into_t(k) = min_j [phi(j, k) - into_s(j)] with into_t(0) = 0. Returns the rest.
double SplitEdge(const TrwsProblem& problem, int s, Side side, std::vector<float>& into_t) {
  const int t = problem.node(s).neighbour[side];
  const bool later = side == kRight || side == kDown;
  const float* table = later ? problem.Table(s, side) : problem.Table(t, OppositeSide(side));
  const float* into_s = problem.Incoming(s, side);
  const int count_s = problem.node(s).patch_count;
  const int count_t = problem.node(t).patch_count;
  float rest = 0.0F;
  for (int i = 0; i < count_s; ++i) rest = std::min(rest, -into_s[i]);
  into_t.assign(count_t, 0.0F);
  for (int j = 0; j < count_t; ++j) {
    for (int i = 0; i < count_s; ++i) {
      const float phi = later ? table[i * count_t + j] : table[j * count_s + i];
      into_t[j] = std::min(into_t[j], phi - into_s[i]);
    }
    into_t[j] -= rest;
  }
  return rest;
}

// Takes the window A out of the grid: from here on the seams' messages stand for all that lies outside of it. Returns
// the sum of the rests of the seams to windows that are still undecided; the others' were counted by the earlier
// window.
double CutSeams(Window& window, SeamMessages& seams) {
  TrwsProblem& problem = window.problem();
  double rests = 0.0;
  for (int s = 0; s < window.node_count(); ++s) {
    if (!window.InWindow(s)) continue;
    for (const Side side : kSides) {
      if (!window.HasSeam(s, side)) continue;
      std::vector<float>& seam = seams.At(window.column(s), window.row(s), side);
      const int t = problem.node(s).neighbour[side];
      if (t < 0) {
        std::copy(seam.begin(), seam.end(), problem.Incoming(s, side));
      } else {
        rests += SplitEdge(problem, s, side, seam);
        problem.CutEdge(s, side);
      }
    }
  }
  return rests;
}

}  // namespace

SeamMessages::SeamMessages(int columns, int rows, const std::vector<int>& column_bounds,
                           const std::vector<int>& row_bounds)
    : seam_of_column_(columns, -1), seam_of_row_(rows, -1) {
  for (size_t i = 1; i + 1 < column_bounds.size(); ++i) seam_of_column_[column_bounds[i]] = static_cast<int>(i) - 1;
  for (size_t i = 1; i + 1 < row_bounds.size(); ++i) seam_of_row_[row_bounds[i]] = static_cast<int>(i) - 1;
  vertical_.assign(column_bounds.size() - 2, std::vector<std::vector<float>>(rows));
  horizontal_.assign(row_bounds.size() - 2, std::vector<std::vector<float>>(columns));
}

std::vector<float>& SeamMessages::At(int column, int row, Side side) {
  if (side == kLeft || side == kRight) {
    const int seam = seam_of_column_[side == kLeft ? column : column + 1];
    MW_CHECK(seam >= 0);
    return vertical_[seam][row];
  }
  const int seam = seam_of_row_[side == kUp ? row : row + 1];
  MW_CHECK(seam >= 0);
  return horizontal_[seam][column];
}

WindowResult SolveWindow(const GridMrf& mrf, const NodeRect& window_rect, const NodeRect& grown,
                         const TrwsStopping& stopping, std::vector<uint8_t>& labels, SeamMessages& seams) {
  Window window(mrf, window_rect, grown, labels);
  TrwsProblem& problem = window.problem();
  TrwsResult run = RunTrws(problem, stopping);
  const std::vector<uint8_t> best = BestLabelling(problem);
  WindowResult result{run.lower_bound, run.iterations, std::move(run.bound_trace)};

  const double rests = CutSeams(window, seams);
  std::vector<uint8_t> active(window.node_count(), 0);
  for (int s = 0; s < window.node_count(); ++s) {
    if (!window.InWindow(s)) continue;
    active[s] = 1;
    labels[window.grid_node(s)] = best[s];
  }
  const bool is_whole_grid = window_rect.column_end - window_rect.column_begin == mrf.columns &&
                             window_rect.row_end - window_rect.row_begin == mrf.rows;
  if (!is_whole_grid) {
    TrwsStopping bound_stopping = stopping;
    bound_stopping.max_iterations = std::min(stopping.max_iterations, kBoundIterations);
    result.lower_bound = rests + RunTrws(problem, bound_stopping, active).lower_bound;
  }
  return result;
}

}  // namespace meshwright
