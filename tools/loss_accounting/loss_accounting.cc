// SPDX-License-Identifier: Apache-2.0
#include "tools/loss_accounting/loss_accounting.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <absl/strings/str_format.h>

#include "common/base/check.h"

namespace meshwright {
namespace {

constexpr std::array<const char*, kLossStages> kKeys = {"seen_by_one", "inconsistent", "hidden",  "not_reached",
                                                        "filtered",    "unsupported",  "refused", "lost_in_join"};

}  // namespace

std::string Describe(LossStage stage) {
  switch (stage) {
    case LossStage::kSeenByOne:
      return "seen by fewer than two cameras";
    case LossStage::kInconsistent:
      return "the true patch's score is below the threshold";
    case LossStage::kHidden:
      return "hidden behind accepted false surface";
    case LossStage::kNotReached:
      return "would pass, but neither seeds nor growing came there";
    case LossStage::kFiltered:
      return "grown, dropped by the MRF";
    case LossStage::kUnsupported:
      return "in one camera's filtered surface only";
    case LossStage::kRefused:
      return "in several cameras' filtered surfaces, outvoted";
    case LossStage::kLostInJoin:
      return "accepted, lost when the parts were joined";
  }
  return "";
}

nlohmann::ordered_json ToJson(const LossReport& report) {
  nlohmann::ordered_json lost = nlohmann::ordered_json::object();
  for (size_t stage = 0; stage < kLossStages; ++stage) lost[kKeys[stage]] = report.lost[stage];
  return {{"ground_truth_pixels", report.ground_truth_pixels},
          {"found", report.found},
          {"lost", std::move(lost)},
          {"cameras_not_followed", report.cameras_not_followed}};
}

std::string ToText(const LossReport& report) {
  const double whole = std::max<double>(1, static_cast<double>(report.ground_truth_pixels));
  const auto row = [&](const std::string& name, int64_t pixels) {
    return absl::StrFormat("  %-56s %7.3f%%\n", name, 100 * static_cast<double>(pixels) / whole);
  };
  std::string text = absl::StrFormat("of %d ground-truth pixels\n", report.ground_truth_pixels);
  text +=
      row(absl::StrFormat("found within %g pixel footprints", LossAccounting::kToleranceInFootprints), report.found);
  for (size_t stage = 0; stage < kLossStages; ++stage) {
    text += row(Describe(static_cast<LossStage>(stage)), report.lost[stage]);
  }
  if (report.cameras_not_followed > 0) {
    text += absl::StrFormat("  %d cameras were done by an earlier process and could not be followed\n",
                            report.cameras_not_followed);
  }
  return text;
}

absl::Status LossAccounting::Check(const TriangleMesh& ground_truth) {
  if (ground_truth.faces.empty()) return absl::InvalidArgumentError("ground truth has no faces, expected a mesh");
  for (size_t f = 0; f < ground_truth.faces.size(); ++f) {
    const uint32_t largest = *std::max_element(ground_truth.faces[f].begin(), ground_truth.faces[f].end());
    if (largest >= ground_truth.positions.size()) {
      return absl::InvalidArgumentError(absl::StrFormat("ground truth: face %d names vertex %d, expected less than %d",
                                                        f, largest, ground_truth.positions.size()));
    }
  }
  return absl::OkStatus();
}

LossAccounting::LossAccounting(const TriangleMesh& ground_truth, std::vector<Camera> cameras, int lattice_step,
                               ThreadPool& pool)
    : cameras_(std::move(cameras)), outcomes_(cameras_.size()) {
  const MeshRayCaster caster(ground_truth);
  for (const Camera& camera : cameras_) truth_.push_back(RenderDepth(caster, camera, lattice_step, pool));
}

double LossAccounting::PlaneDistanceInFootprints(CameraIndex camera, size_t node, double depth) const {
  const auto c = static_cast<size_t>(camera);
  const DepthMap& truth = truth_[c];
  const auto columns = static_cast<size_t>(truth.lattice.columns);
  const Eigen::Vector2d pixel = truth.lattice.Pixel(static_cast<int>(node % columns), static_cast<int>(node / columns));
  const Eigen::Vector3d normal_in_cam =
      cameras_[c].cam_from_world.rotation * truth.normal_in_world[node].cast<double>();
  const double cosine = std::abs(normal_in_cam.dot(cameras_[c].RayInCam(pixel.x(), pixel.y())));
  return std::abs(depth - truth.depth[node]) * cosine * cameras_[c].focal() / truth.depth[node];
}

bool LossAccounting::IsRight(CameraIndex camera, size_t node, double depth) const {
  return depth > 0 && PlaneDistanceInFootprints(camera, node, depth) <= kToleranceInFootprints;
}

LossAccounting::Outcome LossAccounting::OutcomeOfJob(const CameraJobInput& input, const PatchScorer& scorer,
                                                     const CameraJobOptions& options, const PatchStacks& grown,
                                                     const PatchLattice& filtered, size_t node) const {
  const CameraIndex camera = input.reference.camera_index;
  const DepthMap& truth = truth_[static_cast<size_t>(camera)];
  if (IsRight(camera, node, filtered.depth[node])) return Outcome::kFiltered;
  for (int32_t i = grown.first[node]; i >= 0; i = grown.patches[static_cast<size_t>(i)].next) {
    if (IsRight(camera, node, 1.0 / grown.patches[static_cast<size_t>(i)].plane.w)) return Outcome::kGrown;
  }
  // On accepted surface nothing is grown again; whoever it belongs to answers for it.
  const double accepted_depth = input.accepted.depth[node];
  if (IsRight(camera, node, accepted_depth)) return Outcome::kUnknown;
  if (accepted_depth > 0 && accepted_depth < truth.depth[node]) return Outcome::kHidden;

  const auto columns = static_cast<size_t>(truth.lattice.columns);
  const int x = truth.lattice.PixelX(static_cast<int>(node % columns));
  const int y = truth.lattice.PixelY(static_cast<int>(node / columns));
  const Camera& reference = input.reference.camera;
  const PatchPlane true_plane =
      PlaneFromNormal(reference, x + 0.5, y + 0.5, truth.depth[node],
                      reference.cam_from_world.rotation * truth.normal_in_world[node].cast<double>());
  PatchScorer::Window window;
  scorer.MakeWindow(x, y, window);
  for (int target = 0; target < scorer.targets(); ++target) {
    if (scorer.Score(window, x, y, true_plane, target) > options.growing.min_quality) return Outcome::kNotReached;
  }
  return Outcome::kInconsistent;
}

void LossAccounting::RecordJob(const CameraJobInput& input, const CameraJobOptions& options, const PatchStacks& grown,
                               const PatchLattice& filtered, ThreadPool& pool) {
  const auto camera = static_cast<size_t>(input.reference.camera_index);
  MW_CHECK(camera < cameras_.size());
  const DepthMap& truth = truth_[camera];
  const auto nodes = truth.depth.size();
  MW_CHECK(filtered.depth.size() == nodes && grown.first.size() == nodes);
  const PatchScorer scorer = MakeScorer(input, options.scoring);
  std::vector<Outcome> outcomes(nodes, Outcome::kUnknown);
  pool.ParallelFor(static_cast<int64_t>(nodes), 4096, [&](int64_t begin, int64_t end) {
    for (auto node = static_cast<size_t>(begin); node < static_cast<size_t>(end); ++node) {
      if (truth.depth[node] > 0) outcomes[node] = OutcomeOfJob(input, scorer, options, grown, filtered, node);
    }
  });
  const MutexLock lock(mutex_);
  outcomes_[camera] = std::move(outcomes);
}

void LossAccounting::RecordAccepted(const PatchLattice& accepted) {
  const auto camera = static_cast<size_t>(accepted.camera_index);
  const DepthMap& truth = truth_[camera];
  const MutexLock lock(mutex_);
  if (outcomes_[camera].empty()) return;
  for (size_t node = 0; node < truth.depth.size(); ++node) {
    if (truth.depth[node] > 0 && IsRight(accepted.camera_index, node, accepted.depth[node])) {
      outcomes_[camera][node] = Outcome::kAccepted;
    }
  }
}

LossStage LossAccounting::StageOf(const Eigen::Vector3d& x_in_world) const {
  // Nodes next to a point show it: a pixel footprint or two beside it in the plane of its surface.
  constexpr double kSamePlaceInFootprints = 4;
  int views = 0;
  int filtered = 0;
  auto furthest = Outcome::kUnknown;
  for (size_t c = 0; c < cameras_.size(); ++c) {
    const DepthMap& truth = truth_[c];
    const Eigen::Vector3d x_in_cam = cameras_[c].CamFromWorld(x_in_world);
    if (!(x_in_cam.z() > 0)) continue;
    const Eigen::Vector2d place = truth.lattice.FromPixel(cameras_[c].ProjectFromCam(x_in_cam));
    if (!(place.cwiseAbs().maxCoeff() < 1e6)) continue;
    const auto column = static_cast<int>(std::lround(place.x()));
    const auto row = static_cast<int>(std::lround(place.y()));
    if (!truth.lattice.Contains(column, row)) continue;
    const auto node = static_cast<size_t>(truth.lattice.Index(column, row));
    if (!(truth.depth[node] > 0)) continue;
    if (PlaneDistanceInFootprints(static_cast<CameraIndex>(c), node, x_in_cam.z()) > kSamePlaceInFootprints) continue;
    ++views;
    if (outcomes_[c].empty()) continue;
    const Outcome outcome = outcomes_[c][node];
    furthest = std::max(furthest, outcome);
    filtered += outcome >= Outcome::kFiltered ? 1 : 0;
  }
  if (furthest == Outcome::kAccepted) return LossStage::kLostInJoin;
  if (views < 2) return LossStage::kSeenByOne;
  switch (furthest) {
    case Outcome::kAccepted:
      return LossStage::kLostInJoin;
    case Outcome::kFiltered:
      return filtered > 1 ? LossStage::kRefused : LossStage::kUnsupported;
    case Outcome::kGrown:
      return LossStage::kFiltered;
    case Outcome::kNotReached:
      return LossStage::kNotReached;
    case Outcome::kHidden:
      return LossStage::kHidden;
    case Outcome::kInconsistent:
    case Outcome::kUnknown:
      break;
  }
  return LossStage::kInconsistent;
}

LossReport LossAccounting::Account(const TriangleMesh& mesh, ThreadPool& pool) const {
  const MeshRayCaster caster(mesh);
  LossReport report;
  for (size_t c = 0; c < cameras_.size(); ++c) {
    report.cameras_not_followed += outcomes_[c].empty() ? 1 : 0;
    const DepthMap& truth = truth_[c];
    const Lattice& lattice = truth.lattice;
    std::vector<LossReport> rows(static_cast<size_t>(lattice.rows));
    pool.ParallelFor(lattice.rows, 4, [&](int64_t begin, int64_t end) {
      for (auto row = static_cast<int>(begin); row < end; ++row) {
        LossReport& counts = rows[static_cast<size_t>(row)];
        for (int column = 0; column < lattice.columns; ++column) {
          const double z = truth.depth[static_cast<size_t>(lattice.Index(column, row))];
          if (!(z > 0)) continue;
          ++counts.ground_truth_pixels;
          const Eigen::Vector2d pixel = lattice.Pixel(column, row);
          const Eigen::Vector3d x = cameras_[c].BackProject(pixel.x(), pixel.y(), z);
          if (caster.Nearest(x, kToleranceInFootprints * z / cameras_[c].focal()).ok()) {
            ++counts.found;
          } else {
            ++counts.lost[static_cast<size_t>(StageOf(x))];
          }
        }
      }
    });
    for (const LossReport& row : rows) {
      report.ground_truth_pixels += row.ground_truth_pixels;
      report.found += row.found;
      for (size_t stage = 0; stage < kLossStages; ++stage) report.lost[stage] += row.lost[stage];
    }
  }
  return report;
}

}  // namespace meshwright
