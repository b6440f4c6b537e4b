// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "common/base/ids.h"
#include "common/base/thread_pool.h"
#include "coordinator/incidence/camera_probes.h"
#include "coordinator/incidence/overlap_graph.h"

namespace meshwright {

// How much of what a camera sees will still have to be grown when its turn comes, before any of it is. What K_a + 1
// cameras have grown is accepted, and who comes later finds it covered (sections 3.4 and 3.7, Jancosek et al. 2009); so
// a point that n cameras see is grown by K_a + 1 of them. Points are the cameras' probes: a model of the scene, for
// times and for nothing else.
class SurfaceToGrow {
 public:
  // `k_a`: K_a. Cameras whose row in `overlaps` is empty have no part in it.
  SurfaceToGrow(const std::vector<CameraGeometry>& cameras, const std::vector<CameraProbes>& probes,
                const OverlapGraph& overlaps, int k_a, ThreadPool& pool);

  // The camera has been processed, or will not be. Each once.
  void Commit(CameraIndex camera, bool is_processed);

  // Share of the camera's rays that are to be grown, of those that see surface, 0 .. 1: if it were its turn now, and
  // expected for when its turn comes, whoever comes before it.
  double ShareNow(CameraIndex camera) const;
  double ExpectedShare(CameraIndex camera) const;

 private:
  struct Point {
    uint16_t grown_by = 0;  // processed cameras that see it
    uint16_t waiting = 0;   // cameras that see it and are still to come, its own included
  };

  bool Sees(CameraIndex camera, size_t owner, size_t point) const;
  // The mean of share(point) over the camera's points.
  template <typename Share>
  double MeanOf(CameraIndex camera, const Share& share) const;
  size_t PointsOf(size_t camera) const { return first_point_[camera + 1] - first_point_[camera]; }

  const std::vector<CameraGeometry>& cameras_;
  const std::vector<CameraProbes>& probes_;
  const OverlapGraph& overlaps_;
  const int needed_;  // cameras that have to grow a point
  std::vector<size_t> first_point_;
  std::vector<Point> points_;
};

}  // namespace meshwright
