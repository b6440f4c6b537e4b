// SPDX-License-Identifier: Apache-2.0
#include "worker/mrf/solve.h"

#include <algorithm>
#include <cmath>

#include <absl/strings/str_format.h>

#include "common/base/check.h"
#include "common/base/out_of_range.h"
#include "worker/mrf/window.h"

namespace meshwright {
namespace {

// Bounds of equal parts of [0, count), each at most `size`.
std::vector<int> EqualParts(int count, int size) {
  const int parts = std::max(1, (count + size - 1) / size);
  std::vector<int> bounds;
  for (int i = 0; i <= parts; ++i) bounds.push_back(static_cast<int>(static_cast<int64_t>(count) * i / parts));
  return bounds;
}

MrfSolution Solve(const GridMrf& mrf, const TrwsOptions& options, int window_nodes, ThreadPool& pool) {
  CheckGridMrf(mrf);
  MW_CHECK(options.Validate().ok());
  MrfSolution solution;
  solution.labels.resize(mrf.NodeCount());
  for (int node = 0; node < mrf.NodeCount(); ++node) {
    solution.labels[node] = mrf.PatchCount(node) == 0 ? 0 : kUndecided;
  }
  const std::vector<int> column_bounds = EqualParts(mrf.columns, window_nodes);
  const std::vector<int> row_bounds = EqualParts(mrf.rows, window_nodes);
  const int window_columns = static_cast<int>(column_bounds.size()) - 1;
  const int window_rows = static_cast<int>(row_bounds.size()) - 1;
  SeamMessages seams(mrf.columns, mrf.rows, column_bounds, row_bounds);
  const TrwsStopping stopping{options.max_iterations, static_cast<float>(options.message_tolerance)};
  std::vector<WindowResult> results(static_cast<size_t>(window_columns) * window_rows);
  for (int round = 0; round < 4; ++round) {
    std::vector<int> windows;
    for (int row = round / 2; row < window_rows; row += 2) {
      for (int column = round % 2; column < window_columns; column += 2)
        windows.push_back(row * window_columns + column);
    }
    pool.ParallelFor(static_cast<int64_t>(windows.size()), 1, [&](int64_t begin, int64_t end) {
      for (int64_t i = begin; i < end; ++i) {
        const int row = windows[i] / window_columns;
        const int column = windows[i] % window_columns;
        const NodeRect window{column_bounds[column], column_bounds[column + 1], row_bounds[row], row_bounds[row + 1]};
        const NodeRect grown{std::max(0, window.column_begin - options.margin_nodes),
                             std::min(mrf.columns, window.column_end + options.margin_nodes),
                             std::max(0, window.row_begin - options.margin_nodes),
                             std::min(mrf.rows, window.row_end + options.margin_nodes)};
        results[windows[i]] = SolveWindow(mrf, window, grown, stopping, solution.labels, seams);
      }
    });
  }
  solution.windows = static_cast<int>(results.size());
  solution.energy = MrfEnergy(mrf, solution.labels);
  solution.lower_bound = static_cast<double>(mrf.NodeCount()) * mrf.label0_cost;
  for (WindowResult& result : results) {
    solution.lower_bound += result.lower_bound;
    solution.iterations = std::max(solution.iterations, result.iterations);
  }
  // Where both are the same number, the bound's rounding must not put it above.
  solution.lower_bound = std::min(solution.lower_bound, solution.energy);
  if (results.size() == 1) {
    solution.bound_trace = std::move(results.front().bound_trace);
    for (double& bound : solution.bound_trace) bound += static_cast<double>(mrf.NodeCount()) * mrf.label0_cost;
  }
  return solution;
}

}  // namespace

absl::Status TrwsOptions::Validate() const {
  if (max_iterations < 1) {
    return OutOfRange("trws.max_iterations", max_iterations, ">= 1");
  }
  if (!(message_tolerance >= 0.0) || !std::isfinite(message_tolerance)) {
    return OutOfRange("trws.message_tolerance", message_tolerance, ">= 0");
  }
  if (margin_nodes < 1) {
    return OutOfRange("trws.margin_nodes", margin_nodes, ">= 1");
  }
  if (window_nodes < 2 * margin_nodes + 2) {
    return absl::InvalidArgumentError(absl::StrFormat("trws.window_nodes is %d, must be >= 2 * margin_nodes + 2 = %d",
                                                      window_nodes, 2 * margin_nodes + 2));
  }
  return absl::OkStatus();
}

MrfSolution SolveGlobal(const GridMrf& mrf, const TrwsOptions& options) {
  ThreadPool pool(1);
  return Solve(mrf, options, std::max({1, mrf.columns, mrf.rows}), pool);
}

MrfSolution SolveInWindows(const GridMrf& mrf, const TrwsOptions& options, ThreadPool& pool) {
  return Solve(mrf, options, options.window_nodes, pool);
}

}  // namespace meshwright
