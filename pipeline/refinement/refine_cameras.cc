// SPDX-License-Identifier: Apache-2.0
#include "pipeline/refinement/refine_cameras.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include <Eigen/Geometry>

#include "pipeline/refinement/bundle_adjustment.h"

#include "common/base/status_macros.h"
#include "coordinator/incidence/target_selection.h"
#include "worker/job_input/view_cache.h"
#include "worker/photo_consistency/halved_view.h"
#include "worker/seeding/seeding.h"
#include "worker/tie_points/tie_points.h"
#include "worker/visibility/accepted_depth.h"

namespace meshwright {
namespace {

constexpr int kTargets = 5;
constexpr int kLatticeStep = 3;   // px, of seeds
constexpr int kCells = 18;        // tie points of a reference are spread over so many cells in both directions
constexpr int kWindowRadius = 5;  // px; a point's place is measured on more than its depth
constexpr int kLevels = 3;
constexpr int kSmallest = 120;     // px, longest side
constexpr int kSmallestSide = 16;  // px; no SamplingImage has smaller levels
constexpr int kMaxPasses = 4;      // on photographs of one size
constexpr size_t kHeldOut = 4;     // one of so many points has no say
constexpr size_t kMinHeldOut = 50;
// What errors must fall to: less gain is by chance.
constexpr double kEnough = 0.95;

// The views' cameras for photographs of one size.
std::vector<Camera> Halved(std::vector<Camera> cameras, int times) {
  for (Camera& camera : cameras) {
    for (int i = 0; i < times; ++i) {
      camera.width /= 2;
      camera.height /= 2;
      for (double* const length : {&camera.fx, &camera.fy, &camera.cx, &camera.cy}) *length /= 2;
    }
  }
  return cameras;
}

// Tie points: those that move the cameras, and those that judge it.
struct Ties {
  Tracks used;
  Tracks held_out;
};

class Refinement {
 public:
  Refinement(const Scene& scene, const ReconstructionOptions& options, const RefinementEnvironment& environment)
      : scene_(scene), options_(options), environment_(environment), pool_(*environment.pool) {
    size_ = options.max_image_size > 0 ? std::min(options.max_image_size, kRefinedOn) : kRefinedOn;
    for (const SceneView& view : scene.views) given_.push_back(UndistortedCamera(view, size_));
    int64_t largest = 0;
    for (const Camera& camera : given_) {
      largest = std::max(largest, SamplingImageBytes(camera.width, camera.height));
      longest_ = std::max({longest_, camera.width, camera.height});
      shortest_ = std::min({shortest_, camera.width, camera.height});
    }
    // Neighbours are each other's targets, mostly; twice what one reference needs.
    views_.emplace([this](CameraIndex camera) { return environment_.load(camera, size_); },
                   2 * (kTargets + 1) * largest);
  }

  absl::StatusOr<CameraRefinement> Run() {
    CameraRefinement result;
    const absl::StatusOr<FeasiblePairs> pairs =
        FindFeasiblePairs(given_, scene_.points, options_.conductor.pairs, pool_);
    if (!pairs.ok()) {
      result.reason = "no pair of photographs";
      return result;
    }
    ChooseTargetsFrom(*pairs);
    std::vector<Camera> cameras = given_;
    Ties ties;
    int first_level = kLevels - 1;
    while (first_level > 0 && (longest_ >> first_level < kSmallest || shortest_ >> first_level < kSmallestSide)) {
      --first_level;
    }
    for (int level = first_level; level >= 0; --level) {
      for (int pass = 0; pass < kMaxPasses; ++pass) {
        MW_ASSIGN_OR_RETURN(
            ties, FindTies(cameras, level, (first_level - level) / (first_level + 1.0), 1 / (first_level + 1.0)));
        if (ties.held_out.size() < kMinHeldOut) break;
        const std::vector<Camera> halved = Halved(cameras, level);
        const std::vector<Camera> moved = AdjustBundle(halved, ties.used, {}, pool_);
        const double before = MedianError(ties.held_out, halved, pool_);
        const double after = MedianError(ties.held_out, moved, pool_);
        if (!(after < kEnough * before)) break;
        for (size_t i = 0; i < cameras.size(); ++i) cameras[i].cam_from_world = moved[i].cam_from_world;
      }
    }
    result.tie_points = static_cast<int64_t>(ties.used.size() + ties.held_out.size());
    // The last measurements are the finest, and say where points are whatever the cameras are.
    const double px = PixelsOfPhotographsUsed();
    const double before = px * MedianError(ties.held_out, given_, pool_);
    const double after = px * MedianError(ties.held_out, cameras, pool_);
    if (ties.held_out.size() < kMinHeldOut || !std::isfinite(before)) {
      result.reason = "too few points that several photographs show";
      return result;
    }
    result.error_px_before = result.error_px_after = before;
    if (!(after < kEnough * before)) return result;
    result.error_px_after = after;
    PutBackInPlace(ties.used, cameras);
    result.off_px = px * MedianMove(ties.used, cameras);
    for (const Camera& camera : cameras) result.cam_from_world.push_back(camera.cam_from_world);
    return result;
  }

 private:
  // In a pixel of the photographs measured on.
  double PixelsOfPhotographsUsed() const {
    const Camera used = UndistortedCamera(scene_.views.front(), options_.max_image_size);
    return std::max(used.width, used.height) /
           static_cast<double>(std::max(given_.front().width, given_.front().height));
  }

  void ChooseTargetsFrom(const FeasiblePairs& pairs) {
    const std::vector<CameraGeometry> geometries = CameraGeometries(given_);
    TargetSelectionOptions selection = options_.conductor.targets;
    selection.max_targets = kTargets;
    for (CameraIndex camera = 0; camera < pairs.matrix.cameras(); ++camera) {
      targets_.push_back(ChooseTargets(camera, pairs.matrix.Neighbours(camera), geometries, pairs.probes, selection));
    }
    points_of_camera_.resize(given_.size());
    for (size_t i = 0; i < scene_.points.size(); ++i) {
      for (const CameraIndex camera : scene_.points[i].seen_by) {
        points_of_camera_[static_cast<size_t>(camera)].push_back(i);
      }
    }
  }

  // `begun` and `share`: of the whole work, for who waits.
  absl::StatusOr<Ties> FindTies(const std::vector<Camera>& cameras, int level, double begun, double share) {
    const std::vector<Camera> halved = Halved(cameras, level);
    Ties ties;
    size_t tracks = 0;
    for (size_t reference = 0; reference < halved.size(); ++reference) {
      if (targets_[reference].empty()) continue;
      const double done = begun + share * static_cast<double>(reference) / static_cast<double>(halved.size());
      told_ = std::max(told_, done);  // another pass on the same photographs is not counted
      if (!environment_.progress(told_)) return absl::CancelledError("stopped");
      MW_ASSIGN_OR_RETURN(const std::vector<TiePoint> points, TiePointsOf(reference, halved, level));
      std::vector<Observation> track;
      for (const TiePoint& point : points) {
        track = {{static_cast<CameraIndex>(reference), point.pixel}};
        for (const TiePoint::Sight& sight : point.sights) {
          track.push_back({targets_[reference][static_cast<size_t>(sight.target)], sight.pixel});
        }
        (tracks++ % kHeldOut == 0 ? ties.held_out : ties.used).Add(track);
      }
    }
    return ties;
  }

  absl::StatusOr<std::vector<TiePoint>> TiePointsOf(size_t reference, const std::vector<Camera>& cameras, int level) {
    const auto view_of = [&](CameraIndex camera) -> absl::StatusOr<ScoredView> {
      MW_ASSIGN_OR_RETURN(const std::shared_ptr<const SamplingImage> grey, views_->Grey(camera));
      // `cameras` are where the passes before have moved them.
      ScoredView view = Halved(ScoredView{given_[static_cast<size_t>(camera)], grey}, level);
      view.camera = cameras[static_cast<size_t>(camera)];
      return view;
    };
    MW_ASSIGN_OR_RETURN(const ScoredView view, view_of(static_cast<CameraIndex>(reference)));
    std::vector<ScoredView> targets;
    for (const CameraIndex target : targets_[reference]) {
      MW_ASSIGN_OR_RETURN(targets.emplace_back(), view_of(target));
    }
    const AcceptedDepth nothing = AcceptedDepth::Empty(view.camera, kLatticeStep);
    const PatchScorer scorer(view, targets, options_.job.scoring, scene_.region);
    const std::vector<Seed> seeds =
        FindSeeds(scorer, PointsOf(reference), nothing, nothing.lattice, options_.job.seeding, pool_).seeds;
    PatchScorer::Options wide = options_.job.scoring;
    wide.window_radius = kWindowRadius;
    return MeasureTiePoints(PatchScorer(view, targets, wide, scene_.region), nothing.lattice, seeds, kCells, pool_);
  }

  std::vector<SparsePointObservation> PointsOf(size_t reference) const {
    std::vector<SparsePointObservation> observations;
    for (const size_t i : points_of_camera_[reference]) {
      const SparsePoint& point = scene_.points[i];
      SparsePointObservation observation{point.x_in_world, 0};
      for (size_t t = 0; t < targets_[reference].size(); ++t) {
        if (std::ranges::binary_search(point.seen_by, targets_[reference][t])) observation.seen_by |= uint32_t{1} << t;
      }
      observations.push_back(observation);
    }
    return observations;
  }

  // Cameras may have gone some way together. The similarity that brings the points back, those that fit it least left
  // out.
  void PutBackInPlace(const Tracks& tracks, std::vector<Camera>& cameras) const {
    std::vector<Eigen::Vector3d> now;
    std::vector<Eigen::Vector3d> before;
    for (size_t i = 0; i < tracks.size(); ++i) {
      const Eigen::Vector3d x_now = Triangulate(tracks.Of(i), cameras, 1);
      const Eigen::Vector3d x_before = Triangulate(tracks.Of(i), given_, 1);
      if (!x_now.allFinite() || !x_before.allFinite()) continue;
      now.push_back(x_now);
      before.push_back(x_before);
    }
    Eigen::Matrix4d given_from_now = Eigen::Matrix4d::Identity();
    constexpr int kRounds = 3;
    for (int round = 0; round < kRounds; ++round) {
      std::vector<std::pair<double, size_t>> by_distance;
      for (size_t i = 0; i < now.size(); ++i) {
        by_distance.emplace_back(((given_from_now * now[i].homogeneous()).head<3>() - before[i]).norm(), i);
      }
      std::ranges::sort(by_distance);
      const auto kept = static_cast<Eigen::Index>((by_distance.size() + 1) / 2);
      if (kept < 3) return;
      Eigen::Matrix3Xd from(3, kept);
      Eigen::Matrix3Xd to(3, kept);
      for (Eigen::Index k = 0; k < kept; ++k) {
        from.col(k) = now[by_distance[static_cast<size_t>(k)].second];
        to.col(k) = before[by_distance[static_cast<size_t>(k)].second];
      }
      given_from_now = Eigen::umeyama(from, to, true);
      if (!given_from_now.allFinite()) return;
    }
    const double scale = std::cbrt(given_from_now.topLeftCorner<3, 3>().determinant());
    const Eigen::Matrix3d rotation = given_from_now.topLeftCorner<3, 3>() / scale;
    const Eigen::Vector3d shift = given_from_now.topRightCorner<3, 1>();
    for (Camera& camera : cameras) {
      const Eigen::Quaterniond turned(Eigen::Matrix3d(camera.cam_from_world.rotation * rotation.transpose()));
      camera.cam_from_world = {turned.normalized().toRotationMatrix(),
                               scale * camera.cam_from_world.translation - turned.normalized() * shift};
    }
  }

  // By how much points in the photographs went with their cameras, as somebody would see who draws them with both.
  double MedianMove(const Tracks& tracks, const std::vector<Camera>& cameras) const {
    std::vector<double> moves;
    for (size_t i = 0; i < tracks.size(); ++i) {
      const Eigen::Vector3d point = Triangulate(tracks.Of(i), cameras, 1);
      if (!point.allFinite()) continue;
      for (const Observation& observation : tracks.Of(i)) {
        const Camera& given = given_[static_cast<size_t>(observation.camera)];
        const Camera& now = cameras[static_cast<size_t>(observation.camera)];
        if (given.CamFromWorld(point).z() <= 0) continue;
        moves.push_back(
            (now.ProjectFromCam(now.CamFromWorld(point)) - given.ProjectFromCam(given.CamFromWorld(point))).norm());
      }
    }
    if (moves.empty()) return 0;
    const auto middle = moves.begin() + static_cast<std::ptrdiff_t>(moves.size() / 2);
    std::ranges::nth_element(moves, middle);
    return *middle;
  }

  const Scene& scene_;
  const ReconstructionOptions& options_;
  const RefinementEnvironment& environment_;
  ThreadPool& pool_;
  int size_ = 0;  // px, longest side asked for
  int longest_ = 0;
  int shortest_ = std::numeric_limits<int>::max();
  std::vector<Camera> given_;  // of photographs of size_
  std::optional<ViewCache> views_;
  std::vector<std::vector<CameraIndex>> targets_;
  std::vector<std::vector<size_t>> points_of_camera_;
  double told_ = 0;  // of the work, to who waits
};

}  // namespace

absl::StatusOr<CameraRefinement> RefineCameras(const Scene& scene, const ReconstructionOptions& options,
                                               const RefinementEnvironment& environment) {
  if (static_cast<int64_t>(scene.views.size()) > options.refine_cameras) {
    return CameraRefinement{.reason = options.refine_cameras == 0 ? "not asked for" : "too many photographs"};
  }
  return Refinement(scene, options, environment).Run();
}

}  // namespace meshwright
