// SPDX-License-Identifier: Apache-2.0
#include "pipeline/local/time_estimate.h"

#include <algorithm>
#include <cmath>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_join.h>

#include "common/base/bad_input.h"
#include "common/base/process_usage.h"
#include "common/base/status_macros.h"
#include "common/scene/view.h"
#include "coordinator/forecast/surface_to_grow.h"
#include "coordinator/incidence/target_selection.h"
#include "worker/job_input/camera_job_input.h"

namespace meshwright {
namespace {

// A camera is tried with about so many rays.
constexpr double kTriedRays = 40'000;
constexpr int kWidestLattice = 16;  // px
// Threads wait for each other now and then.
constexpr double kEfficiency = 0.9;
// Judging again and joining, roughly, by the seconds of the cameras' growing.
constexpr double kAfterCameras = 0.15;

// A camera that is tried has nothing accepted before it.
class NoBlobs : public BlobStore {
 public:
  absl::StatusOr<std::string> Put(const std::string& /*bytes*/) override { return absl::UnimplementedError("none"); }
  absl::StatusOr<std::string> Get(const std::string& /*digest*/) override { return absl::NotFoundError("none"); }
  absl::StatusOr<bool> Has(const std::string& /*digest*/) override { return false; }
  absl::Status Delete(const std::string& /*digest*/) override { return absl::OkStatus(); }
};

// CPU seconds of what was tried.
struct Trial {
  double loading_a_view = 0;
  double seeding = 0;
  double growing_a_ray = 0;  // with filtering and refinement
  double share_grown = 0;    // of the rays
};

class Estimator {
 public:
  Estimator(const Scene& scene, const ReconstructionOptions& options, int threads)
      : scene_(scene), options_(options), pool_(threads), threads_(threads) {
    for (const SceneView& view : scene.views) cameras_.push_back(UndistortedCamera(view, options.max_image_size));
    geometries_ = CameraGeometries(cameras_);
  }

  absl::StatusOr<TimeEstimate> Estimate() {
    MW_RETURN_IF_ERROR(options_.Validate());
    absl::StatusOr<FeasiblePairs> pairs = FindFeasiblePairs(cameras_, scene_.points, options_.conductor.pairs, pool_);
    if (!pairs.ok()) return BadInput(pairs.status());
    TimeEstimate estimate = {.threads = threads_};
    std::vector<CameraIndex> by_pairs;
    for (CameraIndex camera = 0; camera < pairs->matrix.cameras(); ++camera) {
      if (pairs->matrix.RowSum(camera) > 0) by_pairs.push_back(camera);
    }
    std::ranges::stable_sort(by_pairs, std::greater<>(),
                             [&](CameraIndex camera) { return pairs->matrix.RowSum(camera); });
    estimate.cameras = static_cast<int>(by_pairs.size());

    std::vector<CameraIndex> tried = {by_pairs.front()};
    if (by_pairs.size() > 2) tried.push_back(by_pairs[by_pairs.size() / 2]);
    Trial mean;
    const double begin = MeasureProcessUsage().cpu_seconds;
    for (const CameraIndex camera : tried) {
      MW_ASSIGN_OR_RETURN(const Trial trial, Try(camera, *pairs, estimate));
      const double weight = 1.0 / static_cast<double>(tried.size());
      mean.loading_a_view += weight * trial.loading_a_view;
      mean.seeding += weight * trial.seeding;
      mean.growing_a_ray += weight * trial.growing_a_ray;
      mean.share_grown += weight * trial.share_grown;
    }
    estimate.tried_cpu_seconds = MeasureProcessUsage().cpu_seconds - begin;
    Sum(mean, *pairs, by_pairs, estimate);
    return estimate;
  }

 private:
  int TriedStep(const Camera& camera) const {
    const double pixels = static_cast<double>(camera.width) * camera.height;
    return std::clamp(static_cast<int>(std::ceil(std::sqrt(pixels / kTriedRays))), options_.job.lattice_step,
                      std::max(options_.job.lattice_step, kWidestLattice));
  }

  absl::StatusOr<Trial> Try(CameraIndex camera, const FeasiblePairs& pairs, TimeEstimate& estimate) {
    CameraJobOptions job = options_.job;
    job.lattice_step = TriedStep(cameras_[static_cast<size_t>(camera)]);
    estimate.tried.push_back(scene_.views[static_cast<size_t>(camera)].name);
    estimate.tried_lattice_step = std::max(estimate.tried_lattice_step, job.lattice_step);
    NoBlobs blobs;
    ViewCache views(
        [&](CameraIndex view) { return LoadView(scene_.views[static_cast<size_t>(view)], options_.max_image_size); },
        0);
    const CameraJobInputMaker inputs(scene_, cameras_, views, blobs, job.lattice_step);
    const std::vector<CameraIndex>& neighbours = pairs.matrix.Neighbours(camera);
    const CameraJobSpec spec = {
        .camera = camera,
        .neighbours = neighbours,
        .targets = ChooseTargets(camera, neighbours, geometries_, pairs.probes, options_.conductor.targets)};
    const double begin = MeasureProcessUsage().cpu_seconds;
    MW_ASSIGN_OR_RETURN(const CameraJobInputMaker::Prepared prepared, inputs.Make(spec, pool_));
    const double loaded = MeasureProcessUsage().cpu_seconds;
    const CameraJobReport report = RunCameraJob(prepared.input, job, pool_).report;
    const double job_seconds = MeasureProcessUsage().cpu_seconds - loaded;
    const double growing = report.seconds_growing + report.seconds_filtering + report.seconds_refinement;
    const double wall = std::max(1e-9, report.seconds_seeding + growing);
    return Trial{
        .loading_a_view = (loaded - begin) / static_cast<double>(spec.targets.size() + 1),
        .seeding = job_seconds * report.seconds_seeding / wall,
        .growing_a_ray = job_seconds * growing / wall / std::max<double>(1, static_cast<double>(report.rays_grown)),
        .share_grown = static_cast<double>(report.rays_grown) / std::max<double>(1, static_cast<double>(report.rays))};
  }

  void Sum(const Trial& trial, const FeasiblePairs& pairs, const std::vector<CameraIndex>& processed,
           TimeEstimate& estimate) {
    const OverlapGraph overlaps =
        FindOverlaps(geometries_, pairs.probes, pairs.matrix, options_.conductor.overlap, pool_);
    SurfaceToGrow to_grow(geometries_, pairs.probes, overlaps, options_.conductor.acceptance.k_a, pool_);
    for (CameraIndex camera = 0; camera < pairs.matrix.cameras(); ++camera) {
      if (pairs.matrix.RowSum(camera) == 0) to_grow.Commit(camera, /*is_processed=*/false);
    }
    double rays = 0;
    double grown = 0;
    for (const CameraIndex camera : processed) {
      const Lattice lattice = Lattice::For(cameras_[static_cast<size_t>(camera)], options_.job.lattice_step);
      const auto nodes = static_cast<double>(lattice.nodes());
      rays += nodes;
      grown += nodes * trial.share_grown * to_grow.ExpectedShare(camera);
    }
    estimate.expected_share_grown = rays > 0 ? grown / rays : 0;
    const double growing = grown * trial.growing_a_ray;
    const auto count = static_cast<double>(processed.size());
    estimate.cpu_seconds = count * (trial.loading_a_view + trial.seeding) + growing * (1 + kAfterCameras);
    estimate.wall_seconds = estimate.cpu_seconds / (threads_ * (threads_ > 1 ? kEfficiency : 1));
  }

  const Scene& scene_;
  const ReconstructionOptions& options_;
  ThreadPool pool_;
  const int threads_;
  std::vector<Camera> cameras_;
  std::vector<CameraGeometry> geometries_;
};

std::string Duration(double seconds) {
  const auto whole = static_cast<int64_t>(std::llround(seconds));
  if (whole < 3600) return absl::StrFormat("%d:%02d", whole / 60, whole % 60);
  return absl::StrFormat("%d:%02d:%02d", whole / 3600, whole / 60 % 60, whole % 60);
}

}  // namespace

absl::StatusOr<TimeEstimate> EstimateTime(const Scene& scene, const ReconstructionOptions& options, int threads) {
  return Estimator(scene, options, threads).Estimate();
}

nlohmann::ordered_json ToJson(const TimeEstimate& estimate) {
  return {{"cpu_seconds", estimate.cpu_seconds},
          {"wall_seconds", estimate.wall_seconds},
          {"threads", estimate.threads},
          {"cameras", estimate.cameras},
          {"share_grown", estimate.expected_share_grown},
          {"tried", estimate.tried},
          {"tried_lattice_step", estimate.tried_lattice_step},
          {"tried_cpu_seconds", estimate.tried_cpu_seconds}};
}

std::string ToText(const TimeEstimate& estimate) {
  return absl::StrFormat("about %s on %d threads, %s of CPU; from a trial of %s at a lattice of %d px",
                         Duration(estimate.wall_seconds), estimate.threads, Duration(estimate.cpu_seconds),
                         absl::StrJoin(estimate.tried, ", "), estimate.tried_lattice_step);
}

}  // namespace meshwright
