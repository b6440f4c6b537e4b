// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include <absl/status/statusor.h>

#include "common/base/thread_pool.h"
#include "common/blob/blob_store.h"
#include "common/geometry/camera.h"
#include "common/job/camera_job_spec.h"
#include "common/scene/scene.h"
#include "common/surface/surface_cache.h"
#include "worker/camera_job/camera_job.h"
#include "worker/job_input/view_cache.h"

namespace meshwright {

// Bytes that a job's input takes, photographs shared with other jobs included.
int64_t EstimateInputBytes(const CameraJobSpec& spec, const std::vector<Camera>& cameras, int lattice_step);

// Turns a job's specification into the values that the job works on: photographs, V_r, sparse points.
class CameraJobInputMaker {
 public:
  // `cameras` are those of scene.views, undistorted and scaled. All of it outlives the maker.
  CameraJobInputMaker(const Scene& scene, const std::vector<Camera>& cameras, ViewCache& views, BlobStore& blobs,
                      int lattice_step);

  struct Prepared {
    CameraJobInput input;
    double seconds_loading = 0;     // wall, photographs
    double seconds_visibility = 0;  // wall, V_r (section 3.4)
  };
  // Bad input: a photograph cannot be used (any more). Other errors are the BlobStore's. Thread-safe.
  absl::StatusOr<Prepared> Make(const CameraJobSpec& spec, ThreadPool& pool) const;

  int lattice_step() const { return lattice_step_; }  // px
  const Camera& camera(CameraIndex index) const { return cameras_[static_cast<size_t>(index)]; }

 private:
  absl::Status LoadViews(const CameraJobSpec& spec, CameraJobInput& input, ThreadPool& pool) const;
  absl::Status AddAcceptedSurfaces(const CameraJobSpec& spec, CameraJobInput& input, ThreadPool& pool) const;

  const Scene& scene_;
  const std::vector<Camera>& cameras_;
  ViewCache& views_;
  mutable SurfaceCache surfaces_;  // the same surfaces are drawn for camera after camera
  const int lattice_step_;
  std::vector<std::vector<int32_t>> points_of_camera_;  // positions in scene.points
};

}  // namespace meshwright
