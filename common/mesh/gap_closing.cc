// SPDX-License-Identifier: Apache-2.0
#include "common/mesh/gap_closing.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <memory>
#include <optional>
#include <utility>

#include <Eigen/Geometry>
#include <absl/container/flat_hash_map.h>
#include <absl/container/flat_hash_set.h>

#include "common/base/status_macros.h"
#include "common/closing/free_space_cut.h"
#include "common/closing/surface_witness.h"
#include "common/mesh/point_blocks.h"

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

SpooledVector<ClosingPoint> CollectPoints(const PartBorders& borders, const BorderStitcher& stitcher,
                                          const std::vector<uint8_t>& is_small) {
  SpooledVector<ClosingPoint> points(borders.spool_beside);
  for (size_t part = 0; part + 1 < borders.parts.size(); ++part) {
    const PartBorders::Part& from = borders.parts[part];
    const PartBorders::Part& to = borders.parts[part + 1];
    for (int32_t v = from.first_border; v < to.first_border; ++v) {
      if (!stitcher.IsOpen(v)) continue;
      const BorderVertex& vertex = borders.vertices[static_cast<size_t>(v)];
      points.push_back({{vertex.position.cast<double>(), vertex.spacing}, v, static_cast<int32_t>(part)});
    }
    for (int32_t i = from.first_inner; i < to.first_inner; ++i) {
      const InnerSample& sample = borders.inner[static_cast<size_t>(i)];
      if (is_small[static_cast<size_t>(sample.component)] != 0) continue;
      points.push_back({{sample.position.cast<double>(), sample.spacing}, -1, static_cast<int32_t>(part)});
    }
    borders.Release();
    stitcher.Release();
    points.Release();
  }
  return points;
}

class BlockCloser {
 public:
  BlockCloser(const PartBorders& borders, const SpooledVector<ClosingPoint>& points, const PointBlocks& blocks,
              double reach, const LoadSurface& load)
      : borders_(borders), points_(points), blocks_(blocks), reach_(reach), load_(load) {
    // A camera's first part is what it has measured. A later one is what else it has come to: surface all the same,
    // which no triangle may hide.
    absl::flat_hash_set<CameraIndex> seen;
    for (size_t part = 0; part + 1 < borders.parts.size(); ++part) {
      is_first_.push_back(seen.insert(borders.parts[part].camera_index).second);
    }
  }

  absl::StatusOr<std::vector<BorderStitcher::Face>> TrianglesIn(const PointBlocks::Block& block) const {
    const Eigen::AlignedBox3d box = block.Grown(kMargin);
    std::vector<int32_t> around = blocks_.PointsIn(box);
    std::ranges::sort(around, {}, [&](int32_t i) { return std::pair(At(i).measured.x_in_world.x(), i); });
    std::vector<int64_t> seen_by;
    for (size_t part = 0; part < is_first_.size(); ++part) {
      const MeasuredSpace& space = borders_.parts[part].space;
      if (space.MayReach(box.center(), 0.5 * box.diagonal().norm())) seen_by.push_back(static_cast<int64_t>(part));
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

  std::array<Eigen::Vector3d, 3> CornersOf(const Candidate& candidate) const {
    std::array<Eigen::Vector3d, 3> corners;
    for (size_t k = 0; k < 3; ++k) corners[k] = At(candidate.points[k]).measured.x_in_world;
    return corners;
  }
  Eigen::Vector3d MiddleOf(const Candidate& candidate) const {
    const auto& [a, b, c] = CornersOf(candidate);
    return (a + b + c) / 3;
  }

  // Of indices into `around`.
  absl::StatusOr<Triangles> Cut(const std::vector<int32_t>& around, const std::vector<int64_t>& seen_by) const {
    // A camera once, whatever parts of it there are.
    std::vector<Eigen::Vector3d> centers;
    absl::flat_hash_map<CameraIndex, int32_t> number;
    const auto number_of = [&](const PartBorders::Part& part) {
      const auto [found, is_new] = number.try_emplace(part.camera_index, static_cast<int32_t>(centers.size()));
      if (is_new) centers.push_back(part.space.camera.center_in_world());
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
  const SpooledVector<ClosingPoint>& points_;
  const PointBlocks& blocks_;
  const double reach_;
  const LoadSurface& load_;
  std::vector<bool> is_first_;  // per part: of its camera
};

}  // namespace

absl::StatusOr<std::vector<BorderStitcher::Face>> FindGapTriangles(const PartBorders& borders,
                                                                   const BorderStitcher& stitcher,
                                                                   const std::vector<uint8_t>& is_small, double reach,
                                                                   const LoadSurface& load, ThreadPool& pool,
                                                                   JoinProgress& progress) {
  const SpooledVector<ClosingPoint> points = CollectPoints(borders, stitcher, is_small);
  const PointBlocks blocks(
      static_cast<int32_t>(points.size()),
      [&](int32_t i) { return points[static_cast<size_t>(i)].measured.x_in_world; }, kPointsOfBlock,
      borders.spool_beside);
  const BlockCloser closer(borders, points, blocks, reach, load);
  const auto count = static_cast<int64_t>(blocks.blocks().size());
  std::vector<std::vector<BorderStitcher::Face>> of_block(blocks.blocks().size());
  MW_RETURN_IF_ERROR(ForEachPart(0, count, pool, [&](int64_t i) -> absl::Status {
    const auto index = static_cast<size_t>(i);
    MW_ASSIGN_OR_RETURN(of_block[index], closer.TrianglesIn(blocks.blocks()[index]));
    progress.Step(JoinStage::kClosing, count);
    points.Release();
    blocks.Release();
    return absl::OkStatus();
  }));
  std::vector<BorderStitcher::Face> faces;
  for (const auto& found : of_block) faces.insert(faces.end(), found.begin(), found.end());
  return faces;
}

}  // namespace meshwright
