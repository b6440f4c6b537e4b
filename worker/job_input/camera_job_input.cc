// SPDX-License-Identifier: Apache-2.0
#include "worker/job_input/camera_job_input.h"

#include <string>
#include <utility>

#include <absl/strings/str_cat.h>

#include "common/base/bad_input.h"
#include "common/base/clock.h"
#include "common/base/status_macros.h"
#include "common/surface/codec.h"

namespace meshwright {
namespace {

// Decoded surfaces kept between jobs.
constexpr int64_t kSurfaceCacheBytes = int64_t{64} << 20;

}  // namespace

CameraJobInputMaker::CameraJobInputMaker(const Scene& scene, const std::vector<Camera>& cameras, ViewCache& views,
                                         BlobStore& blobs, int lattice_step)
    : scene_(scene),
      cameras_(cameras),
      views_(views),
      surfaces_(
          [&blobs](const std::string& digest) -> absl::StatusOr<SparseSurface> {
            MW_ASSIGN_OR_RETURN(const std::string bytes, blobs.Get(digest));
            return DecodeSparseSurface(bytes);
          },
          kSurfaceCacheBytes),
      lattice_step_(lattice_step),
      points_of_camera_(cameras.size()) {
  for (size_t i = 0; i < scene.points.size(); ++i) {
    for (const CameraIndex camera : scene.points[i].seen_by) {
      points_of_camera_[static_cast<size_t>(camera)].push_back(static_cast<int32_t>(i));
    }
  }
}

absl::StatusOr<CameraJobInputMaker::Prepared> CameraJobInputMaker::Make(const CameraJobSpec& spec,
                                                                        ThreadPool& pool) const {
  Prepared prepared;
  prepared.input.region = scene_.region;
  Stopwatch stopwatch;
  MW_RETURN_IF_ERROR(LoadViews(spec, prepared.input, pool));
  prepared.seconds_loading = stopwatch.Lap();
  MW_RETURN_IF_ERROR(AddAcceptedSurfaces(spec, prepared.input, pool));
  for (const int32_t i : points_of_camera_[static_cast<size_t>(spec.camera)]) {
    const SparsePoint& point = scene_.points[static_cast<size_t>(i)];
    prepared.input.sparse_points.push_back(point.x_in_world);
    prepared.input.sparse_points_seen_by.push_back(point.seen_by);
  }
  prepared.seconds_visibility = stopwatch.Lap();
  return prepared;
}

absl::Status CameraJobInputMaker::LoadViews(const CameraJobSpec& spec, CameraJobInput& input, ThreadPool& pool) const {
  input.reference = {.camera_index = spec.camera, .camera = cameras_[static_cast<size_t>(spec.camera)]};
  for (const CameraIndex target : spec.targets) {
    input.targets.push_back({.camera_index = target, .camera = cameras_[static_cast<size_t>(target)]});
  }
  std::vector<absl::Status> statuses(spec.targets.size() + 1);
  pool.ParallelFor(static_cast<int64_t>(statuses.size()), 1, [&](int64_t begin, int64_t end) {
    for (auto i = static_cast<size_t>(begin); i < static_cast<size_t>(end); ++i) {
      if (i == 0) {
        auto reference = views_.GreyAndColor(spec.camera);
        statuses[i] = reference.status();
        if (!reference.ok()) continue;
        input.reference.grey = reference->grey;
        input.reference_color = reference->color;
      } else {
        auto grey = views_.Grey(spec.targets[i - 1]);
        statuses[i] = grey.status();
        if (grey.ok()) input.targets[i - 1].grey = *std::move(grey);
      }
    }
  });
  for (const absl::Status& status : statuses) MW_RETURN_IF_ERROR(BadInput(status));
  return absl::OkStatus();
}

absl::Status CameraJobInputMaker::AddAcceptedSurfaces(const CameraJobSpec& spec, CameraJobInput& input,
                                                      ThreadPool& pool) const {
  AcceptedDepthBuffer visible(input.reference.camera, lattice_step_);
  std::vector<absl::Status> statuses(spec.accepted.size());
  pool.ParallelFor(static_cast<int64_t>(statuses.size()), 1, [&](int64_t begin, int64_t end) {
    for (auto i = static_cast<size_t>(begin); i < static_cast<size_t>(end); ++i) {
      const auto surface = surfaces_.Get(spec.accepted[i].digest);
      statuses[i] = surface.status();
      if (surface.ok()) visible.Add(**surface, pool);
    }
  });
  for (const absl::Status& status : statuses) MW_RETURN_IF_ERROR(status);
  input.accepted = visible.Depth();
  return absl::OkStatus();
}

int64_t EstimateInputBytes(const CameraJobSpec& spec, const std::vector<Camera>& cameras, int lattice_step) {
  const Camera& reference = cameras[static_cast<size_t>(spec.camera)];
  int64_t bytes = SamplingImageBytes(reference.width, reference.height);
  bytes += int64_t{3} * reference.width * reference.height;
  bytes += Lattice::For(reference, lattice_step).nodes() * static_cast<int64_t>(2 * sizeof(float));
  for (const CameraIndex target : spec.targets) {
    const Camera& camera = cameras[static_cast<size_t>(target)];
    bytes += SamplingImageBytes(camera.width, camera.height);
  }
  return bytes;
}

}  // namespace meshwright
