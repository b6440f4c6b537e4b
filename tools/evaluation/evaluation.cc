// SPDX-License-Identifier: Apache-2.0
#include "tools/evaluation/evaluation.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <vector>

#include <absl/strings/str_format.h>

#include "tools/evaluation/seen_surface.h"
#include "tools/evaluation/surface_distance.h"
#include "tools/raycast/mesh_ray_caster.h"

#include "common/base/status_macros.h"

namespace meshwright {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr int kSurfaceSamples = 100000;  // for Middlebury's figures
constexpr double kSameSurface = 2;       // pixel footprints along the ray, within which normals are compared
constexpr size_t kThresholdCount = EvaluationReport::kThresholds.size();

// What one row of one picture adds to the report.
struct Counts {
  int64_t ground_truth = 0;
  int64_t seen_by_enough = 0;
  int64_t reconstruction = 0;
  int64_t missing = 0;
  std::array<int64_t, kThresholdCount> recalled = {};
  std::array<int64_t, kThresholdCount> precise = {};
  std::array<int64_t, kThresholdCount> depth_right = {};
  std::vector<float> footprints;     // scene units, of the ground-truth pixels
  std::vector<float> accuracies;     // in g, of the reconstruction's pixels
  std::vector<float> normal_errors;  // degrees
  double turns = 0;                  // degrees, summed over pairs of neighbouring pixels
  double ground_truth_turns = 0;
  int64_t pairs = 0;

  void Add(const Counts& other) {
    ground_truth += other.ground_truth;
    seen_by_enough += other.seen_by_enough;
    reconstruction += other.reconstruction;
    missing += other.missing;
    for (size_t k = 0; k < kThresholdCount; ++k) {
      recalled[k] += other.recalled[k];
      precise[k] += other.precise[k];
      depth_right[k] += other.depth_right[k];
    }
    footprints.insert(footprints.end(), other.footprints.begin(), other.footprints.end());
    accuracies.insert(accuracies.end(), other.accuracies.begin(), other.accuracies.end());
    normal_errors.insert(normal_errors.end(), other.normal_errors.begin(), other.normal_errors.end());
    turns += other.turns;
    ground_truth_turns += other.ground_truth_turns;
    pairs += other.pairs;
  }
};

// Element at `share` of the sorted values; infinite when there are none.
template <class T>
double Quantile(std::vector<T> values, double share) {
  if (values.empty()) return kInfinity;
  const auto position = static_cast<size_t>(std::lround(share * static_cast<double>(values.size() - 1)));
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(position), values.end());
  return values[position];
}

double Share(int64_t part, int64_t whole) {
  return whole > 0 ? static_cast<double>(part) / static_cast<double>(whole) : 0.0;
}

// The normals at a pixel where both surfaces are the same one.
struct PixelNormals {
  Eigen::Vector3d reconstruction;
  Eigen::Vector3d ground_truth;
};

double DegreesBetween(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::acos(std::clamp(a.dot(b), -1.0, 1.0)) * 180 / std::numbers::pi;
}

// The two surfaces with what is asked of them.
class Comparison {
 public:
  Comparison(const TriangleMesh& reconstruction, const TriangleMesh& ground_truth, absl::Span<const Camera> cameras,
             const EvaluationOptions& options, ThreadPool& pool)
      : reconstruction_(reconstruction),
        ground_truth_(ground_truth),
        cameras_(cameras),
        options_(options),
        pool_(pool),
        reconstruction_caster_(reconstruction),
        ground_truth_caster_(ground_truth),
        to_reconstruction_(reconstruction, reconstruction_caster_),
        to_ground_truth_(ground_truth, ground_truth_caster_) {}

  Counts CountPixels() const {
    Counts total;
    for (const Camera& camera : cameras_) {
      const SeenSurface truth = SeeSurface(ground_truth_, ground_truth_caster_, camera, options_.pixel_stride, pool_);
      const SeenSurface seen =
          SeeSurface(reconstruction_, reconstruction_caster_, camera, options_.pixel_stride, pool_);
      std::vector<Counts> rows(static_cast<size_t>(truth.lattice.rows));
      pool_.ParallelFor(truth.lattice.rows, 1, [&](int64_t begin, int64_t end) {
        for (int64_t row = begin; row < end; ++row) {
          Counts& counts = rows[static_cast<size_t>(row)];
          std::optional<PixelNormals> left;
          for (int column = 0; column < truth.lattice.columns; ++column) {
            const int64_t node = truth.lattice.Index(column, static_cast<int>(row));
            if (truth.depth[static_cast<size_t>(node)] > 0) {
              CountPixel(camera, truth, seen, static_cast<size_t>(node), counts);
            }
            const std::optional<PixelNormals> here = NormalsAt(camera, truth, seen, static_cast<size_t>(node));
            CountNormals(left, here, counts);
            left = here;
          }
        }
      });
      for (const Counts& row : rows) total.Add(row);
    }
    return total;
  }

  double Accuracy90() const {
    std::vector<Eigen::Vector3d> samples;
    if (reconstruction_.faces.empty()) {
      const size_t step = reconstruction_.positions.size() / kSurfaceSamples + 1;
      for (size_t i = 0; i < reconstruction_.positions.size(); i += step) {
        samples.emplace_back(reconstruction_.positions[i].cast<double>());
      }
    } else {
      for (const SurfaceSample& sample : SampleSurface(reconstruction_, kSurfaceSamples)) samples.push_back(sample.x);
    }
    std::vector<double> distances(samples.size());
    pool_.ParallelFor(static_cast<int64_t>(samples.size()), 256, [&](int64_t begin, int64_t end) {
      for (int64_t i = begin; i < end; ++i) {
        distances[static_cast<size_t>(i)] = to_ground_truth_.Within(samples[static_cast<size_t>(i)], kInfinity);
      }
    });
    return Quantile(std::move(distances), 0.9);
  }

  double Completeness(double distance) const {
    const std::vector<SurfaceSample> samples = SampleSurface(ground_truth_, kSurfaceSamples);
    enum : uint8_t { kNotSeen, kFar, kNear };
    std::vector<uint8_t> outcome(samples.size(), kNotSeen);
    pool_.ParallelFor(static_cast<int64_t>(samples.size()), 256, [&](int64_t begin, int64_t end) {
      for (int64_t i = begin; i < end; ++i) {
        const SurfaceSample& sample = samples[static_cast<size_t>(i)];
        const Eigen::Vector3d normal = ground_truth_caster_.FaceNormal(sample.face);
        if (!IsSeen(sample.x, normal) && !IsSeen(sample.x, -normal)) continue;
        outcome[static_cast<size_t>(i)] = to_reconstruction_.Within(sample.x, distance) <= distance ? kNear : kFar;
      }
    });
    const int64_t near = std::count(outcome.begin(), outcome.end(), kNear);
    const int64_t far = std::count(outcome.begin(), outcome.end(), kFar);
    return Share(near, near + far);
  }

 private:
  bool IsSeen(const Eigen::Vector3d& x, const Eigen::Vector3d& normal) const {
    return IsSeenByEnough(ground_truth_caster_, cameras_, x, normal, options_.min_views, options_.occlusion_tolerance);
  }

  std::optional<PixelNormals> NormalsAt(const Camera& camera, const SeenSurface& truth, const SeenSurface& seen,
                                        size_t node) const {
    if (reconstruction_.faces.empty() || !(truth.depth[node] > 0) || !(seen.depth[node] > 0)) return std::nullopt;
    const double g = truth.depth[node] / camera.focal();
    if (std::abs(seen.depth[node] - truth.depth[node]) > kSameSurface * g) return std::nullopt;
    const Eigen::Vector3d ray = truth.x_in_world[node] - camera.center_in_world();
    const auto towards_camera = [&](Eigen::Vector3d normal) {
      return normal.dot(ray) > 0 ? Eigen::Vector3d(-normal) : normal;
    };
    return PixelNormals{towards_camera(reconstruction_caster_.FaceNormal(seen.face[node])),
                        towards_camera(ground_truth_caster_.FaceNormal(truth.face[node]))};
  }

  static void CountNormals(const std::optional<PixelNormals>& left, const std::optional<PixelNormals>& here,
                           Counts& counts) {
    if (!here.has_value()) return;
    counts.normal_errors.push_back(static_cast<float>(DegreesBetween(here->reconstruction, here->ground_truth)));
    if (!left.has_value()) return;
    counts.turns += DegreesBetween(left->reconstruction, here->reconstruction);
    counts.ground_truth_turns += DegreesBetween(left->ground_truth, here->ground_truth);
    ++counts.pairs;
  }

  // A pixel with ground truth.
  void CountPixel(const Camera& camera, const SeenSurface& truth, const SeenSurface& seen, size_t node,
                  Counts& counts) const {
    constexpr double kLargest = EvaluationReport::kThresholds.back();
    const double z_truth = truth.depth[node];
    const double z_seen = seen.depth[node];
    const Eigen::Vector3d& x_truth = truth.x_in_world[node];
    const Eigen::Vector3d& x_seen = seen.x_in_world[node];
    const double g_truth = z_truth / camera.focal();
    ++counts.ground_truth;
    counts.footprints.push_back(static_cast<float>(g_truth));
    double apart = kInfinity;  // along the pixel's ray; no surface is further from the other one's point
    if (z_seen > 0) {
      apart = (x_seen - x_truth).norm();
      const double g_seen = z_seen / camera.focal();
      const double accuracy =
          std::min(apart, to_ground_truth_.Within(x_seen, std::min(apart, kLargest * g_seen))) / g_seen;
      ++counts.reconstruction;
      counts.accuracies.push_back(static_cast<float>(accuracy <= kLargest ? accuracy : kInfinity));
      for (size_t k = 0; k < kThresholdCount; ++k) {
        const double threshold = EvaluationReport::kThresholds[k];
        counts.precise[k] += accuracy <= threshold ? 1 : 0;
        counts.depth_right[k] += std::abs(z_seen - z_truth) < threshold * g_truth ? 1 : 0;
      }
    } else {
      ++counts.missing;
    }
    Eigen::Vector3d normal = ground_truth_caster_.FaceNormal(truth.face[node]);
    if (normal.dot(camera.center_in_world() - x_truth) < 0) normal = -normal;
    if (!IsSeen(x_truth, normal)) return;
    ++counts.seen_by_enough;
    // What is nearer than the smallest threshold need not be known more exactly.
    double distance = apart;
    if (apart > EvaluationReport::kThresholds.front() * g_truth) {
      distance = std::min(apart, to_reconstruction_.Within(x_truth, std::min(apart, kLargest * g_truth)));
    }
    for (size_t k = 0; k < kThresholdCount; ++k) {
      counts.recalled[k] += distance <= EvaluationReport::kThresholds[k] * g_truth ? 1 : 0;
    }
  }

  const TriangleMesh& reconstruction_;
  const TriangleMesh& ground_truth_;
  absl::Span<const Camera> cameras_;
  const EvaluationOptions& options_;
  ThreadPool& pool_;
  MeshRayCaster reconstruction_caster_;
  MeshRayCaster ground_truth_caster_;
  SurfaceDistance to_reconstruction_;
  SurfaceDistance to_ground_truth_;
};

absl::Status CheckMesh(const char* name, const TriangleMesh& mesh) {
  for (size_t f = 0; f < mesh.faces.size(); ++f) {
    const uint32_t largest = *std::max_element(mesh.faces[f].begin(), mesh.faces[f].end());
    if (largest >= mesh.positions.size()) {
      return absl::InvalidArgumentError(absl::StrFormat("%s: face %d names vertex %d, expected less than %d", name, f,
                                                        largest, mesh.positions.size()));
    }
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status EvaluationOptions::Validate() const {
  const auto error = [](const char* field, double value, const char* expected) {
    return absl::InvalidArgumentError(
        absl::StrFormat("EvaluationOptions.%s is %g, expected %s", field, value, expected));
  };
  if (pixel_stride < 1) return error("pixel_stride", pixel_stride, "at least 1");
  if (min_views < 1) return error("min_views", min_views, "at least 1");
  if (!(occlusion_tolerance >= 0 && occlusion_tolerance <= 100)) {
    return error("occlusion_tolerance", occlusion_tolerance, "0 .. 100");
  }
  if (!(completeness_distance >= 0) || !std::isfinite(completeness_distance)) {
    return error("completeness_distance", completeness_distance, "0 or more");
  }
  return absl::OkStatus();
}

absl::StatusOr<EvaluationReport> Evaluate(const TriangleMesh& reconstruction, const TriangleMesh& ground_truth,
                                          absl::Span<const Camera> cameras, const EvaluationOptions& options,
                                          ThreadPool& pool) {
  MW_RETURN_IF_ERROR(options.Validate());
  MW_RETURN_IF_ERROR(CheckMesh("reconstruction", reconstruction));
  MW_RETURN_IF_ERROR(CheckMesh("ground truth", ground_truth));
  if (cameras.empty()) return absl::InvalidArgumentError("evaluation needs at least one camera, got none");
  if (ground_truth.faces.empty()) {
    return absl::InvalidArgumentError("ground truth has no faces, expected a mesh");
  }
  const Comparison comparison(reconstruction, ground_truth, cameras, options, pool);
  Counts counts = comparison.CountPixels();
  if (counts.ground_truth == 0) {
    return absl::InvalidArgumentError(
        "no camera sees the ground truth, expected it in the same world frame as the cameras");
  }
  EvaluationReport report;
  for (size_t k = 0; k < kThresholdCount; ++k) {
    report.recall[k] = Share(counts.recalled[k], counts.seen_by_enough);
    report.precision[k] = Share(counts.precise[k], counts.reconstruction);
    const double sum = report.recall[k] + report.precision[k];
    report.f_score[k] = sum > 0 ? 2 * report.recall[k] * report.precision[k] / sum : 0;
    report.depth[k] = Share(counts.depth_right[k], counts.ground_truth);
  }
  report.missing = Share(counts.missing, counts.ground_truth);
  report.median_accuracy_g = Quantile(std::move(counts.accuracies), 0.5);
  if (!counts.normal_errors.empty()) {
    const auto within = [&](float degrees) {
      return Share(std::ranges::count_if(counts.normal_errors, [=](float error) { return error <= degrees; }),
                   static_cast<int64_t>(counts.normal_errors.size()));
    };
    report.normals_within_10_deg = within(10);
    report.normals_within_30_deg = within(30);
    report.median_normal_error_deg = Quantile(std::move(counts.normal_errors), 0.5);
  }
  if (counts.pairs > 0) {
    report.roughness_deg = counts.turns / static_cast<double>(counts.pairs);
    report.ground_truth_roughness_deg = counts.ground_truth_turns / static_cast<double>(counts.pairs);
  }
  report.median_footprint = Quantile(std::move(counts.footprints), 0.5);
  report.ground_truth_pixels = counts.ground_truth;
  report.recall_pixels = counts.seen_by_enough;
  report.precision_pixels = counts.reconstruction;
  report.completeness_distance =
      options.completeness_distance > 0 ? options.completeness_distance : 2 * report.median_footprint;
  report.accuracy_90 = comparison.Accuracy90();
  report.completeness = comparison.Completeness(report.completeness_distance);
  return report;
}

}  // namespace meshwright
