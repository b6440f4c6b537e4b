// SPDX-License-Identifier: Apache-2.0
#include "coordinator/incidence/target_selection.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <absl/strings/str_cat.h>

#include "common/base/out_of_range.h"

namespace meshwright {
namespace {

// Angle between two directions by its chord, 2 sin(angle / 2): monotonic, and free of libm, whose last bits differ
// between machines. Within 1 % of the angle up to 28 degrees.
double Chord(const Eigen::Vector3d& unit_a, const Eigen::Vector3d& unit_b) { return (unit_a - unit_b).norm(); }

double ChordOfDegrees(double degrees) { return 2 * std::sin(0.5 * degrees * std::numbers::pi / 180); }

double Square(double x) { return x * x; }

// 1 between best_min and best_max; below it falls with the square as depth becomes uncertain, above it slowly as the
// windows stop looking alike.
double AngleWeight(double chord, double best_min, double best_max) {
  if (chord < best_min) return Square(chord / best_min);
  if (chord <= best_max) return 1;
  return 1 / (1 + Square((chord - best_max) / best_max));
}

// What one neighbour gives at one probe of the reference.
struct ProbeScore {
  double weight = 0;                                    // 0: does not see it
  Eigen::Vector3d to_camera = Eigen::Vector3d::Zero();  // unit, from the probe
};

}  // namespace

absl::Status TargetSelectionOptions::Validate() const {
  if (max_targets < 1) {
    return OutOfRange("max_targets", max_targets, ">= 1");
  }
  if (!(best_min_angle_deg > 0 && best_min_angle_deg <= best_max_angle_deg && best_max_angle_deg <= 90)) {
    return absl::InvalidArgumentError(absl::StrCat("best_min_angle_deg = ", best_min_angle_deg,
                                                   ", best_max_angle_deg = ", best_max_angle_deg,
                                                   ", expected 0 < min <= max <= 90"));
  }
  if (!(apart_angle_deg > 0 && apart_angle_deg <= 90)) {
    return OutOfRange("apart_angle_deg", apart_angle_deg, "> 0, <= 90");
  }
  return absl::OkStatus();
}

std::vector<CameraIndex> ChooseTargets(CameraIndex reference, const std::vector<CameraIndex>& neighbours,
                                       const std::vector<CameraGeometry>& cameras,
                                       const std::vector<CameraProbes>& probes, const TargetSelectionOptions& options) {
  const CameraGeometry& r = cameras[static_cast<size_t>(reference)];
  const std::vector<Eigen::Vector3d>& points = probes[static_cast<size_t>(reference)].in_world;
  const double best_min = ChordOfDegrees(options.best_min_angle_deg);
  const double best_max = ChordOfDegrees(options.best_max_angle_deg);
  const double apart = ChordOfDegrees(options.apart_angle_deg);

  std::vector<CameraIndex> candidates = neighbours;
  std::sort(candidates.begin(), candidates.end());
  std::vector<std::vector<ProbeScore>> scores(candidates.size(), std::vector<ProbeScore>(points.size()));
  for (size_t c = 0; c < candidates.size(); ++c) {
    const auto t = static_cast<size_t>(candidates[c]);
    for (size_t p = 0; p < points.size(); ++p) {
      if (!SeesWithinDepths(cameras[t], probes[t], points[p])) continue;
      const Eigen::Vector3d to_r = (r.center_in_world - points[p]).normalized();
      scores[c][p].to_camera = (cameras[t].center_in_world - points[p]).normalized();
      scores[c][p].weight =
          AngleWeight(Chord(to_r, scores[c][p].to_camera), best_min, best_max) * ScaleRatio(r, cameras[t], points[p]);
    }
  }

  std::vector<CameraIndex> targets;
  std::vector<bool> taken(candidates.size(), false);
  while (targets.size() < static_cast<size_t>(options.max_targets) && targets.size() < candidates.size()) {
    size_t best = candidates.size();
    double best_score = -1;
    for (size_t c = 0; c < candidates.size(); ++c) {
      if (taken[c]) continue;
      double score = 0;
      for (const ProbeScore& at_probe : scores[c]) score += at_probe.weight;
      if (score > best_score) {
        best = c;
        best_score = score;
      }
    }
    taken[best] = true;
    targets.push_back(candidates[best]);
    // The weights of the rest shrink where the one just chosen looks from about the same side.
    for (size_t c = 0; c < candidates.size(); ++c) {
      if (taken[c]) continue;
      for (size_t p = 0; p < points.size(); ++p) {
        if (scores[best][p].weight <= 0 || scores[c][p].weight <= 0) continue;
        const double chord = Chord(scores[best][p].to_camera, scores[c][p].to_camera);
        if (chord < apart) scores[c][p].weight *= Square(chord / apart);
      }
    }
  }
  return targets;
}

}  // namespace meshwright
