// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include <absl/status/status.h>

#include "common/base/thread_pool.h"
#include "worker/mrf/grid_mrf.h"

namespace meshwright {

struct TrwsOptions {
  // Iterations (a forward and a backward pass) per window at most; >= 1. A window is done earlier when no message
  // changes.
  int max_iterations = 50;
  // A message that would change by no more than this is left as it is, and a node whose messages stay is not visited
  // again; cost (unary costs are about 1), >= 0. 0: the textbook algorithm.
  double message_tolerance = 2e-3;
  // Largest side of a window A; lattice nodes, >= 2 * margin_nodes + 2. Sec. 3.7.
  int window_nodes = 256;
  // What B has more than A on each side; lattice nodes, >= 1. Sec. 3.7 ("not farther than 50 nodes from A").
  int margin_nodes = 50;

  absl::Status Validate() const;
};

struct MrfSolution {
  std::vector<uint8_t> labels;  // one per node
  double energy = 0.0;          // of labels, by MrfEnergy
  double lower_bound = 0.0;     // no labelling of the whole grid has less energy
  int windows = 0;
  int iterations = 0;               // largest number in a window
  std::vector<double> bound_trace;  // SolveGlobal only: the bound after each iteration (see TrwsResult)
};

// Both minimise the energy approximately by TRW-S (see trws.h); labels, energy and bound do not depend on the number of
// threads. The energy is always finite, and that of SolveGlobal never above label 0 everywhere.

// The whole grid at once. lower_bound is that of TRW-S.
MrfSolution SolveGlobal(const GridMrf& mrf, const TrwsOptions& options);

// By windows (Jancosek et al. 2009, sec. 3.7), for grids whose pairwise costs do not fit into memory: the grid is cut
// into equal windows A; for each the problem in B, A grown by the margin, is solved and the labels inside A are fixed.
// Labels fixed by earlier windows are conditions of the later ones, so there are no seams; nodes outside B that are not
// yet fixed are ignored. The windows are taken in four rounds, (even row, even column), (even, odd), (odd, even), (odd,
// odd): those of a round do not touch each other and are solved in parallel. (Raster order would solve the same number
// of nodes: each pair of adjacent windows is grown into one another once, whichever comes first.)
//
// lower_bound is a bound for the whole grid too, by dual decomposition: every edge between two windows keeps the
// messages that the earlier window's B left on it, which moves its cost to its two ends and a rest. Then the grid falls
// apart into the windows A, each free of any condition, whose TRW-S bounds (from a few more iterations) add up with the
// rests' minima. On surfaces it is about as tight as the global run's.
MrfSolution SolveInWindows(const GridMrf& mrf, const TrwsOptions& options, ThreadPool& pool);

}  // namespace meshwright
