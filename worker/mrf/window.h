// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "worker/mrf/grid_mrf.h"
#include "worker/mrf/trws.h"

namespace meshwright {

// Half-open rectangle of lattice nodes.
struct NodeRect {
  int column_begin = 0;
  int column_end = 0;
  int row_begin = 0;
  int row_end = 0;

  bool Contains(int column, int row) const {
    return column >= column_begin && column < column_end && row >= row_begin && row < row_end;
  }
};

// Not yet decided (GridMrf::kMaxPatches is the largest label).
inline constexpr uint8_t kUndecided = 255;

// The edges between windows: what the later end's patches get to bear of the edge's cost (the message of the earlier
// window), so that the later window's lower bound can be computed without knowing the earlier one's labels.
class SeamMessages {
 public:
  SeamMessages(int columns, int rows, const std::vector<int>& column_bounds, const std::vector<int>& row_bounds);

  // The message of the edge between node (column, row) and its neighbour on that side, which lies in another window.
  std::vector<float>& At(int column, int row, Side side);

 private:
  std::vector<int> seam_of_column_;                          // index of the seam left of the column, -1: none
  std::vector<int> seam_of_row_;                             // above the row
  std::vector<std::vector<std::vector<float>>> vertical_;    // [seam][row]
  std::vector<std::vector<std::vector<float>>> horizontal_;  // [seam][column]
};

struct WindowResult {
  double lower_bound = 0.0;  // of this window's part of the decomposition (see SolveInWindows)
  int iterations = 0;
  std::vector<double> bound_trace;
};

// Solves the problem in B = `grown` given the labels that are decided, writes the labels of `window` = A, and the
// messages of the seams to windows still undecided.
WindowResult SolveWindow(const GridMrf& mrf, const NodeRect& window, const NodeRect& grown,
                         const TrwsStopping& stopping, std::vector<uint8_t>& labels, SeamMessages& seams);

}  // namespace meshwright
