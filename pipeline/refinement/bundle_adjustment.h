// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "common/base/ids.h"
#include "common/base/thread_pool.h"
#include "common/geometry/camera.h"

namespace meshwright {

// Where a photograph shows a point of the scene.
struct Observation {
  CameraIndex camera = 0;
  Eigen::Vector2f pixel = Eigen::Vector2f::Zero();  // px of the undistorted photograph
};

// Points of the scene, each with its observations in two photographs or more.
class Tracks {
 public:
  void Add(std::span<const Observation> observations);
  size_t size() const { return begins_.size() - 1; }
  bool empty() const { return size() == 0; }
  std::span<const Observation> Of(size_t track) const {
    return {observations_.data() + begins_[track], begins_[track + 1] - begins_[track]};
  }
  size_t observations() const { return observations_.size(); }

 private:
  std::vector<Observation> observations_;
  std::vector<size_t> begins_ = {0};
};

// The point that a track's observations agree on: the least sum of robust squared reprojection errors. Not finite: they
// agree on none in front of all of their cameras. `scale_px`: of errors; those well above it count little.
Eigen::Vector3d Triangulate(std::span<const Observation> track, const std::vector<Camera>& cameras, double scale_px);

// Median length of the reprojection errors, px, of all tracks' points that there are; NaN when there is none.
double MedianError(const Tracks& tracks, const std::vector<Camera>& cameras, ThreadPool& pool);

struct BundleAdjustmentOptions {
  int max_sweeps = 60;
  double least_gain = 1e-3;   // of the median error by a sweep; with less of it the end has come
  int min_observations = 20;  // of a camera; with fewer it stays as it is
};

// Moves the cameras to where their photographs agree better (Triggs et al. 2000, Bundle adjustment, by
// alternation: resection and intersection in turns): every track's point is put where its observations want it, then
// every camera where its points do. One step of it is local: a point looks at its cameras, a camera at its points, so
// work and memory are linear in the observations and a camera's error goes to rest with its neighbours'. What it is
// slow at is what bends a scene as a whole while neighbours agree, and that is for the cameras' maker to know.
// Intrinsics stay. The result does not depend on the number of threads.
std::vector<Camera> AdjustBundle(std::vector<Camera> cameras, const Tracks& tracks,
                                 const BundleAdjustmentOptions& options, ThreadPool& pool);

}  // namespace meshwright
