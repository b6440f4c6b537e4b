// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <utility>
#include <vector>

#include <absl/status/status.h>

#include "common/base/thread_pool.h"
#include "coordinator/incidence/camera_probes.h"
#include "coordinator/incidence/incidence_matrix.h"

namespace meshwright {

// When two cameras count as seeing the same surface.
struct OverlapOptions {
  double min_share = 0.05;  // share of either camera's probes that both see, 0..1
  double max_angle_deg =
      120;  // between their rays at the probe, degrees, 0..180: a patch is seen up to 60 from its normal

  absl::Status Validate() const;
};

// Which cameras may see the same surface; symmetric, without the camera itself. Not the same as a feasible pair: two
// photographs from one spot have no baseline but one surface. It limits what runs at the same time (schedule), says
// whose F_i may support F_r (acceptance) and whose M_i may hide what r sees (visibility). Where it errs it includes.
class OverlapGraph {
 public:
  explicit OverlapGraph(int cameras = 0) : rows_(static_cast<size_t>(cameras)) {}
  // `rows` must be symmetric, ascending, without the diagonal.
  explicit OverlapGraph(std::vector<std::vector<CameraIndex>> rows) : rows_(std::move(rows)) {}

  int cameras() const { return static_cast<int>(rows_.size()); }
  // Ascending.
  const std::vector<CameraIndex>& Of(CameraIndex camera) const { return rows_[static_cast<size_t>(camera)]; }
  bool Overlap(CameraIndex i, CameraIndex j) const;

 private:
  std::vector<std::vector<CameraIndex>> rows_;
};

// Overlap by probes (see camera_probes.h): each camera's few points are looked for in the others' images and depths.
// Feasible pairs always overlap. Costs at most 2 * kMaxProbes projections per pair whose frusta come near each other
// (see ball_grid.h): the other pairs of a large scene cost nothing.
OverlapGraph FindOverlaps(const std::vector<CameraGeometry>& cameras, const std::vector<CameraProbes>& probes,
                          const IncidenceMatrix& feasible, const OverlapOptions& options, ThreadPool& pool);

}  // namespace meshwright
