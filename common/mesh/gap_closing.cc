// SPDX-License-Identifier: Apache-2.0
#include "common/mesh/gap_closing.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <memory>
#include <numeric>
#include <optional>
#include <utility>

#include <Eigen/Geometry>
#include <absl/container/flat_hash_map.h>
#include <absl/container/flat_hash_set.h>

#include "common/base/status_macros.h"
#include "common/closing/free_space_cut.h"
#include "common/closing/surface_witness.h"

namespace meshwright {
namespace {

// Points of a block, less those around it that are looked at with it.
constexpr size_t kPointsOfBlock = 10'000;
// How far around a block, as a share of its longest side.
constexpr double kMargin = 0.1;
// A camera has measured a point when its surface passes within so many spacings.
constexpr double kMeasuredSpacings = 3;
// So many cameras have to vouch for a triangle.
constexpr int kMinVouchers = 2;
// Rays that may pass through a triangle: a few whatever its size, and a share of those of one camera that faces it, as
// rims are noise.
constexpr double kStrayRays = 2;
constexpr double kStrayShare = 0.05;

// What the cut is made of, all of it or a block's part.
struct ClosingPoint {
  MeasuredPoint measured;
  int32_t vertex = -1;  // of the border, when triangles may end here
  int32_t part = 0;
};

// A box that shares no point with another block's: low <= x < high.
struct Block {
  Eigen::Vector3d low = Eigen::Vector3d::Constant(-std::numeric_limits<double>::infinity());
  Eigen::Vector3d high = Eigen::Vector3d::Constant(std::numeric_limits<double>::infinity());
  std::vector<int32_t> points;

  bool Contains(const Eigen::Vector3d& x) const {
    return (x.array() >= low.array()).all() && (x.array() < high.array()).all();
  }
};

std::vector<ClosingPoint> CollectPoints(const PartBorders& borders, const std::function<bool(int32_t)>& is_open,
                                        const std::vector<uint8_t>& is_small) {
  std::vector<ClosingPoint> points;
  for (size_t part = 0; part + 1 < borders.parts.size(); ++part) {
    const PartBorders::Part& from = borders.parts[part];
    const PartBorders::Part& to = borders.parts[part + 1];
    for (int32_t v = from.first_border; v < to.first_border; ++v) {
      if (!is_open(v)) continue;
      const BorderVertex& vertex = borders.vertices[static_cast<size_t>(v)];
      points.push_back({{vertex.position.cast<double>(), vertex.spacing}, v, static_cast<int32_t>(part)});
    }
    for (int32_t i = from.first_inner; i < to.first_inner; ++i) {
      const InnerSample& sample = borders.inner[static_cast<size_t>(i)];
      if (is_small[static_cast<size_t>(sample.component)] != 0) continue;
      points.push_back({{sample.position.cast<double>(), sample.spacing}, -1, static_cast<int32_t>(part)});
    }
  }
  return points;
}

// Halves the points along the longest side of their box until few enough are left.
void Split(const std::vector<ClosingPoint>& points, Block block, std::vector<Block>& blocks) {
  if (block.points.size() > kPointsOfBlock) {
    const auto at = [&](int32_t i) { return points[static_cast<size_t>(i)].measured.x_in_world; };
    Eigen::AlignedBox3d box;
    for (const int32_t i : block.points) box.extend(at(i));
    Eigen::Index axis = 0;
    box.sizes().maxCoeff(&axis);
    const auto middle = block.points.begin() + static_cast<std::ptrdiff_t>(block.points.size() / 2);
    std::ranges::nth_element(block.points, middle, {}, [&](int32_t i) { return std::pair(at(i)[axis], i); });
    const double border = at(*middle)[axis];
    Block below = {.low = block.low, .high = block.high};
    Block above = below;
    below.high[axis] = border;
    above.low[axis] = border;
    for (const int32_t i : block.points) (at(i)[axis] < border ? below : above).points.push_back(i);
    if (!below.points.empty()) {
      Split(points, std::move(below), blocks);
      Split(points, std::move(above), blocks);
      return;
    }
  }
  if (!block.points.empty()) blocks.push_back(std::move(block));
}

// False only if the camera cannot have measured anything in the box.
bool MaySee(const PartBorders::Part& part, const Eigen::AlignedBox3d& box) {
  const Camera& camera = part.camera;
  const double radius = 0.5 * box.diagonal().norm();
  const Eigen::Vector3d x = camera.CamFromWorld(box.center());
  if (!(part.farthest > 0) || x.z() + radius < part.nearest || x.z() - radius > part.farthest) return false;
  // Distances from the four planes through the camera's centre and the picture's sides.
  const auto is_beyond = [&](double focal, double center_px, double size_px, double across) {
    const double low = center_px / focal;
    const double high = (size_px - center_px) / focal;
    return -across - low * x.z() > radius * std::hypot(1, low) || across - high * x.z() > radius * std::hypot(1, high);
  };
  return !is_beyond(camera.fx, camera.cx, camera.width, x.x()) &&
         !is_beyond(camera.fy, camera.cy, camera.height, x.y());
}

class BlockCloser {
 public:
  BlockCloser(const PartBorders& borders, const std::vector<ClosingPoint>& points, double reach,
              const LoadSurface& load)
      : borders_(borders), points_(points), reach_(reach), load_(load) {
    by_x_.resize(points.size());
    std::iota(by_x_.begin(), by_x_.end(), 0);
    std::ranges::sort(by_x_, {}, [&](int32_t i) { return std::pair(X(i), i); });
    // A camera's first part is what it has measured. A later one is what else it has come to: surface all the same,
    // which no triangle may hide.
    absl::flat_hash_set<CameraIndex> seen;
    for (size_t part = 0; part + 1 < borders.parts.size(); ++part) {
      is_first_.push_back(seen.insert(borders.parts[part].camera_index).second);
    }
  }

  absl::StatusOr<std::vector<BorderStitcher::Face>> TrianglesIn(const Block& block) const {
    Eigen::AlignedBox3d box;
    for (const int32_t i : block.points) box.extend(points_[static_cast<size_t>(i)].measured.x_in_world);
    const double margin = kMargin * box.sizes().maxCoeff();
    box.extend(box.min() - Eigen::Vector3d::Constant(margin));
    box.extend(box.max() + Eigen::Vector3d::Constant(margin));
    const std::vector<int32_t> around = PointsIn(box);
    std::vector<int64_t> seen_by;
    for (size_t part = 0; part < is_first_.size(); ++part) {
      if (MaySee(borders_.parts[part], box)) seen_by.push_back(static_cast<int64_t>(part));
    }
    MW_ASSIGN_OR_RETURN(const Triangles cut, Cut(around, seen_by));
    std::vector<Candidate> candidates;
    for (const auto& [a, b, c] : cut) {
      const Candidate candidate{
          {around[static_cast<size_t>(a)], around[static_cast<size_t>(b)], around[static_cast<size_t>(c)]}};
      const bool may_be = std::ranges::all_of(candidate.points, [&](int32_t i) { return At(i).vertex >= 0; });
      if (may_be && block.Contains(MiddleOf(candidate))) candidates.push_back(candidate);
    }
    MW_RETURN_IF_ERROR(Hear(seen_by, candidates));
    std::vector<BorderStitcher::Face> faces;
    for (const Candidate& candidate : candidates) {
      if (candidate.vouchers < kMinVouchers || IsContradicted(candidate)) continue;
      BorderStitcher::Face& face = faces.emplace_back();
      for (size_t k = 0; k < 3; ++k) face[k] = At(candidate.points[k]).vertex;
    }
    return faces;
  }

 private:
  using Triangles = std::vector<std::array<int32_t, 3>>;
  struct Candidate {
    std::array<int32_t, 3> points;
    int vouchers = 0;
    int64_t looks_through = 0;
  };

  const ClosingPoint& At(int32_t i) const { return points_[static_cast<size_t>(i)]; }
  double X(int32_t i) const { return At(i).measured.x_in_world.x(); }

  std::array<Eigen::Vector3d, 3> CornersOf(const Candidate& candidate) const {
    std::array<Eigen::Vector3d, 3> corners;
    for (size_t k = 0; k < 3; ++k) corners[k] = At(candidate.points[k]).measured.x_in_world;
    return corners;
  }
  Eigen::Vector3d MiddleOf(const Candidate& candidate) const {
    const auto& [a, b, c] = CornersOf(candidate);
    return (a + b + c) / 3;
  }

  std::vector<int32_t> PointsIn(const Eigen::AlignedBox3d& box) const {
    std::vector<int32_t> found;
    const auto by_x = [&](int32_t i) { return X(i); };
    for (auto i = std::ranges::lower_bound(by_x_, box.min().x(), {}, by_x); i != by_x_.end() && X(*i) <= box.max().x();
         ++i) {
      if (box.contains(At(*i).measured.x_in_world)) found.push_back(*i);
    }
    return found;
  }

  // Of indices into `around`.
  absl::StatusOr<Triangles> Cut(const std::vector<int32_t>& around, const std::vector<int64_t>& seen_by) const {
    // A camera once, whatever parts of it there are.
    std::vector<Eigen::Vector3d> centers;
    absl::flat_hash_map<CameraIndex, int32_t> number;
    const auto number_of = [&](const PartBorders::Part& part) {
      const auto [found, is_new] = number.try_emplace(part.camera_index, static_cast<int32_t>(centers.size()));
      if (is_new) centers.push_back(part.camera.center_in_world());
      return found->second;
    };
    std::vector<MeasuredPoint> measured;
    std::vector<Sight> sights;
    std::vector<int32_t> owner;
    for (const int32_t i : around) {
      owner.push_back(number_of(borders_.parts[static_cast<size_t>(At(i).part)]));
      sights.push_back({static_cast<int32_t>(measured.size()), owner.back()});
      measured.push_back(At(i).measured);
    }
    for (const int64_t part : seen_by) {
      if (!is_first_[static_cast<size_t>(part)]) continue;
      MW_ASSIGN_OR_RETURN(const std::shared_ptr<const SparseSurface> surface, load_(part));
      const SurfaceWitness witness(*surface);
      const int32_t camera = number_of(borders_.parts[static_cast<size_t>(part)]);
      for (size_t i = 0; i < measured.size(); ++i) {
        if (owner[i] == camera) continue;
        if (witness.Measured(measured[i].x_in_world, kMeasuredSpacings * measured[i].spacing)) {
          sights.push_back({static_cast<int32_t>(i), camera});
        }
      }
    }
    return CutFreeSpace(measured, centers, sights);
  }

  absl::Status Hear(const std::vector<int64_t>& seen_by, std::vector<Candidate>& candidates) const {
    if (candidates.empty()) return absl::OkStatus();
    for (const int64_t part : seen_by) {
      MW_ASSIGN_OR_RETURN(const std::shared_ptr<const SparseSurface> surface, load_(part));
      const SurfaceWitness witness(*surface);
      std::optional<GapWitness> gap;
      if (is_first_[static_cast<size_t>(part)]) gap.emplace(witness, reach_);
      for (Candidate& candidate : candidates) {
        const std::array<Eigen::Vector3d, 3> corners = CornersOf(candidate);
        if (gap.has_value() && gap->Vouches(corners)) ++candidate.vouchers;
        candidate.looks_through += witness.CountLooksThrough(corners);
      }
    }
    return absl::OkStatus();
  }

  bool IsContradicted(const Candidate& candidate) const {
    const auto& [a, b, c] = CornersOf(candidate);
    double spacing = 0;
    for (const int32_t i : candidate.points) spacing = std::max(spacing, At(i).measured.spacing);
    const double rays = 0.5 * (b - a).cross(c - a).norm() / (spacing * spacing);
    return static_cast<double>(candidate.looks_through) >= kStrayRays + kStrayShare * rays;
  }

  const PartBorders& borders_;
  const std::vector<ClosingPoint>& points_;
  const double reach_;
  const LoadSurface& load_;
  std::vector<int32_t> by_x_;
  std::vector<bool> is_first_;  // per part: of its camera
};

}  // namespace

absl::StatusOr<std::vector<BorderStitcher::Face>> FindGapTriangles(const PartBorders& borders,
                                                                   const std::function<bool(int32_t)>& is_open,
                                                                   const std::vector<uint8_t>& is_small, double reach,
                                                                   const LoadSurface& load, ThreadPool& pool,
                                                                   JoinProgress& progress) {
  const std::vector<ClosingPoint> points = CollectPoints(borders, is_open, is_small);
  std::vector<Block> blocks;
  Block all;
  all.points.resize(points.size());
  std::iota(all.points.begin(), all.points.end(), 0);
  Split(points, std::move(all), blocks);
  const BlockCloser closer(borders, points, reach, load);
  const auto count = static_cast<int64_t>(blocks.size());
  std::vector<std::vector<BorderStitcher::Face>> of_block(blocks.size());
  MW_RETURN_IF_ERROR(ForEachPart(0, count, pool, [&](int64_t i) -> absl::Status {
    MW_ASSIGN_OR_RETURN(of_block[static_cast<size_t>(i)], closer.TrianglesIn(blocks[static_cast<size_t>(i)]));
    progress.Step(JoinStage::kClosing, count);
    return absl::OkStatus();
  }));
  std::vector<BorderStitcher::Face> faces;
  for (const auto& found : of_block) faces.insert(faces.end(), found.begin(), found.end());
  return faces;
}

}  // namespace meshwright
