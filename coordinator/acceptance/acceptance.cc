// SPDX-License-Identifier: Apache-2.0
#include "coordinator/acceptance/acceptance.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "common/base/check.h"
#include "common/base/out_of_range.h"
#include "common/base/status_macros.h"
#include "common/geometry/level_of_detail.h"

namespace meshwright {
namespace {

constexpr int64_t kRowsPerPiece = 8;
// How much coarser than the reference a supporter's own spacing may make the ball.
constexpr double kMaxCoarseness = 2;
// A surface this many support radii behind a patch contradicts it.
constexpr double kClearanceInRadii = 2;

// Looks for patches of one supporter near points.
class SupportIndex {
 public:
  explicit SupportIndex(const SparseSurface& surface) : surface_(surface), finder_(surface) {
    const Lattice& lattice = surface.lattice;
    const Camera& camera = surface.camera;
    for (int column = 0; column < lattice.columns; ++column) {
      ray_x_.push_back(camera.RayInCam(lattice.PixelX(column) + 0.5, 0).x());
    }
    for (int row = 0; row < lattice.rows; ++row) ray_y_.push_back(camera.RayInCam(0, lattice.PixelY(row) + 0.5).y());
  }

  // Whether the supporter looks through the point: it has measured a surface more than `clearance` behind it on all
  // four rays around it.
  bool SeesThrough(const Eigen::Vector3d& x_in_cam, double clearance) const {
    if (x_in_cam.z() <= clearance) return false;
    const Lattice& lattice = surface_.lattice;
    const Eigen::Vector2d at = lattice.FromPixel(surface_.camera.ProjectFromCam(x_in_cam));
    if (!(at.x() >= 0 && at.y() >= 0 && at.x() < lattice.columns - 1 && at.y() < lattice.rows - 1)) return false;
    const int64_t node = lattice.Index(static_cast<int>(at.x()), static_cast<int>(at.y()));
    for (const int64_t corner : {node, node + 1, node + lattice.columns, node + lattice.columns + 1}) {
      const int32_t patch = finder_.At(corner);
      if (patch == PatchFinder::kNone || surface_.IsInferred(static_cast<size_t>(patch))) return false;
      if (surface_.depth[static_cast<size_t>(patch)] < x_in_cam.z() + clearance) return false;
    }
    return true;
  }

  // Whether a patch centre lies within `radius` of the point (in the supporter's frame). Inferred patches count for the
  // like alone.
  bool HasPatchNear(const Eigen::Vector3d& x_in_cam, double radius, bool is_inferred) const {
    if (x_in_cam.z() <= radius) return false;  // a ball that holds the camera: its window would be the whole image
    const Camera& camera = surface_.camera;
    const Lattice& lattice = surface_.lattice;
    const Range tangent_x = TangentRange(x_in_cam.x(), x_in_cam.z(), radius);
    const Range tangent_y = TangentRange(x_in_cam.y(), x_in_cam.z(), radius);
    const Eigen::Vector2d low =
        lattice.FromPixel({camera.fx * tangent_x.low + camera.cx, camera.fy * tangent_y.low + camera.cy});
    const Eigen::Vector2d high =
        lattice.FromPixel({camera.fx * tangent_x.high + camera.cx, camera.fy * tangent_y.high + camera.cy});
    if (high.x() < 0 || high.y() < 0 || low.x() > lattice.columns - 1 || low.y() > lattice.rows - 1) return false;
    const int first_column = static_cast<int>(std::ceil(std::max(low.x(), 0.0)));
    const int first_row = static_cast<int>(std::ceil(std::max(low.y(), 0.0)));
    const int last_column = static_cast<int>(std::min<double>(high.x(), lattice.columns - 1));
    const int last_row = static_cast<int>(std::min<double>(high.y(), lattice.rows - 1));
    if (first_column > last_column || first_row > last_row) return false;

    const double squared_radius = radius * radius;
    // Where surfaces agree, the node in the middle of the window says so at once.
    const int32_t middle = finder_.At(lattice.Index((first_column + last_column) / 2, (first_row + last_row) / 2));
    if (middle != PatchFinder::kNone && IsNear(middle, x_in_cam, squared_radius, is_inferred)) return true;
    const auto low_depth = static_cast<float>(x_in_cam.z() - radius) * (1 - kDepthSlack);
    const auto high_depth = static_cast<float>(x_in_cam.z() + radius) * (1 + kDepthSlack);
    for (int row = first_row; row <= last_row; ++row) {
      const int32_t end = finder_.FirstFrom(lattice.Index(last_column, row) + 1);
      for (int32_t patch = finder_.FirstFrom(lattice.Index(first_column, row)); patch < end; ++patch) {
        const float depth = surface_.depth[static_cast<size_t>(patch)];
        if (depth < low_depth || depth > high_depth) continue;
        if (IsNear(patch, x_in_cam, squared_radius, is_inferred)) return true;
      }
    }
    return false;
  }

 private:
  struct Range {
    double low = 0;
    double high = 0;
  };
  // The depth test in floats only sorts out; IsNear decides.
  static constexpr float kDepthSlack = 1e-6F;

  // Exact bounds of x / z over the ball around (x, z) with z > radius: the two tangents from the camera.
  static Range TangentRange(double x, double z, double radius) {
    const double denominator = z * z - radius * radius;
    const double reach = radius * std::sqrt(x * x + denominator);
    return {(x * z - reach) / denominator, (x * z + reach) / denominator};
  }

  bool IsNear(int32_t patch, const Eigen::Vector3d& x_in_cam, double squared_radius, bool is_inferred) const {
    const auto at = static_cast<size_t>(patch);
    if (surface_.IsInferred(at) && !is_inferred) return false;
    const double z = surface_.depth[at];
    const double dx = z * ray_x_[static_cast<size_t>(surface_.Column(at))] - x_in_cam.x();
    const double dy = z * ray_y_[static_cast<size_t>(surface_.Row(at))] - x_in_cam.y();
    const double dz = z - x_in_cam.z();
    return dx * dx + dy * dy + dz * dz <= squared_radius;
  }

  const SparseSurface& surface_;
  const PatchFinder finder_;
  std::vector<double> ray_x_;  // per column: x / z of the node's ray
  std::vector<double> ray_y_;  // per row
};

// What the supporters say of one patch.
struct Votes {
  uint8_t support = 0;    // cameras with a patch in the ball
  uint8_t conflicts = 0;  // cameras that look through the patch
};

bool IsAccepted(const Votes& votes, const AcceptanceOptions& options) {
  return votes.support >= options.k_a && votes.support > votes.conflicts;
}

// Whether the votes of `remaining` more cameras could still change what IsAccepted says.
bool IsOpen(const Votes& votes, int remaining, const AcceptanceOptions& options) {
  const int lead = static_cast<int>(votes.support) - static_cast<int>(votes.conflicts);
  if (IsAccepted(votes, options)) return lead <= remaining;
  return lead + remaining > 0 && votes.support + remaining >= options.k_a;
}

uint8_t OneMore(uint8_t count) { return count < 255 ? static_cast<uint8_t>(count + 1) : count; }

// Adds one supporter's votes on what is still open; `remaining` cameras vote, this one included.
void CountVotes(const PatchLattice& filtered, const SparseSurface& supporter, int remaining,
                const AcceptanceOptions& options, std::vector<Votes>& votes, ThreadPool& pool) {
  const SupportIndex index(supporter);
  const Camera& reference = filtered.camera;
  const Rigid3 supporter_from_reference = supporter.camera.cam_from_world * Inverse(reference.cam_from_world);
  const Lattice& lattice = filtered.lattice;
  pool.ParallelFor(lattice.rows, kRowsPerPiece, [&](int64_t begin, int64_t end) {
    for (int row = static_cast<int>(begin); row < end; ++row) {
      for (int column = 0; column < lattice.columns; ++column) {
        const auto node = static_cast<size_t>(lattice.Index(column, row));
        if (!(filtered.depth[node] > 0) || !IsOpen(votes[node], remaining, options)) continue;
        const double z = filtered.depth[node];
        const Eigen::Vector3d x_in_supporter =
            supporter_from_reference *
            (z * reference.RayInCam(lattice.PixelX(column) + 0.5, lattice.PixelY(row) + 0.5));
        const double detail = LevelOfDetail(reference, z, lattice.step);
        const double coarser = LevelOfDetail(supporter.camera, x_in_supporter.z(), supporter.lattice.step);
        const double radius =
            options.support_radius_steps * std::max(detail, std::min(coarser, kMaxCoarseness * detail));
        if (index.HasPatchNear(x_in_supporter, radius, filtered.IsInferred(static_cast<int64_t>(node)))) {
          votes[node].support = OneMore(votes[node].support);
        } else if (index.SeesThrough(x_in_supporter, kClearanceInRadii * radius)) {
          votes[node].conflicts = OneMore(votes[node].conflicts);
        }
      }
    }
  });
}

absl::StatusOr<std::vector<Votes>> CollectVotes(const PatchLattice& filtered, int supporters, const SurfaceLoader& load,
                                                const AcceptanceOptions& options, ThreadPool& pool) {
  std::vector<Votes> votes(filtered.depth.size());
  for (int i = 0; i < supporters; ++i) {
    MW_ASSIGN_OR_RETURN(const std::shared_ptr<const SparseSurface> supporter, load(i));
    MW_CHECK(supporter != nullptr && supporter->camera_index != filtered.camera_index);
    CountVotes(filtered, *supporter, supporters - i, options, votes, pool);
  }
  return votes;
}

void ClearNode(int64_t node, PatchLattice& surface) {
  const auto i = static_cast<size_t>(node);
  surface.depth[i] = 0;
  surface.normal_in_world[i].setZero();
  surface.quality[i] = 0;
  surface.rgb[i] = {0, 0, 0};
  surface.links[i] = 0;
}

// Clears links whose other end has no patch any more.
void DropDanglingLinks(PatchLattice& surface) {
  const Lattice& lattice = surface.lattice;
  for (int row = 0; row < lattice.rows; ++row) {
    for (int column = 0; column < lattice.columns; ++column) {
      const int64_t node = lattice.Index(column, row);
      uint8_t& links = surface.links[static_cast<size_t>(node)];
      if (links == 0) continue;
      if (column + 1 >= lattice.columns || !surface.HasPatch(node + 1)) links &= ~PatchLattice::kLinkRight;
      if (row + 1 >= lattice.rows || !surface.HasPatch(node + lattice.columns)) links &= ~PatchLattice::kLinkDown;
    }
  }
}

}  // namespace

absl::Status AcceptanceOptions::Validate() const {
  if (k_a < 1 || k_a > 255) return OutOfRange("k_a", k_a, "1..255");
  if (!(support_radius_steps > 0)) return OutOfRange("support_radius_steps", support_radius_steps, "> 0");
  return absl::OkStatus();
}

absl::StatusOr<AcceptanceResult> AcceptSurface(const PatchLattice& filtered, int supporters, const SurfaceLoader& load,
                                               const AcceptanceOptions& options, ThreadPool& pool) {
  MW_RETURN_IF_ERROR(options.Validate());
  AcceptanceResult result;
  result.patches_filtered = filtered.CountPatches();
  if (result.patches_filtered == 0) supporters = 0;
  MW_ASSIGN_OR_RETURN(const std::vector<Votes> votes, CollectVotes(filtered, supporters, load, options, pool));
  result.supporters_loaded = supporters;
  result.accepted = filtered;
  for (size_t node = 0; node < votes.size(); ++node) {
    const auto index = static_cast<int64_t>(node);
    if (!IsAccepted(votes[node], options) || filtered.IsInferred(index)) ClearNode(index, result.accepted);
  }
  DropDanglingLinks(result.accepted);
  result.patches_accepted = result.accepted.CountPatches();
  return result;
}

absl::StatusOr<FinalSurface> JudgeAgain(const PatchLattice& filtered, const PatchLattice& accepted, int supporters,
                                        const SurfaceLoader& load, const AcceptanceOptions& options, ThreadPool& pool) {
  MW_RETURN_IF_ERROR(options.Validate());
  MW_CHECK(accepted.depth.size() == filtered.depth.size());
  MW_ASSIGN_OR_RETURN(const std::vector<Votes> votes, CollectVotes(filtered, supporters, load, options, pool));
  FinalSurface surface = {.kept = accepted, .late = filtered};
  for (size_t node = 0; node < votes.size(); ++node) {
    const auto index = static_cast<int64_t>(node);
    const bool stays = IsAccepted(votes[node], options);
    if (!stays && filtered.HasPatch(index) && !filtered.IsInferred(index)) {
      const bool is_contradicted = votes[node].conflicts > 0 && votes[node].conflicts >= votes[node].support;
      ++(is_contradicted ? surface.contradicted : surface.unsupported);
    }
    if (!stays) ClearNode(index, surface.kept);
    if (!stays || accepted.HasPatch(index)) ClearNode(index, surface.late);
  }
  DropDanglingLinks(surface.kept);
  DropDanglingLinks(surface.late);
  return surface;
}

int64_t RemoveSmallComponents(int64_t min_patches, PatchLattice& surface) {
  const Lattice& lattice = surface.lattice;
  const int64_t columns = lattice.columns;
  std::vector<bool> visited(surface.depth.size(), false);
  std::vector<int64_t> component;  // its nodes; those from `next` on are still to be expanded
  int64_t removed = 0;
  for (int64_t seed = 0; seed < lattice.nodes(); ++seed) {
    if (!surface.HasPatch(seed) || visited[static_cast<size_t>(seed)]) continue;
    component.assign(1, seed);
    visited[static_cast<size_t>(seed)] = true;
    const auto visit = [&](int64_t node) {
      if (visited[static_cast<size_t>(node)]) return;
      visited[static_cast<size_t>(node)] = true;
      component.push_back(node);
    };
    const auto linked = [&](int64_t node, uint8_t link) {
      return (surface.links[static_cast<size_t>(node)] & link) != 0;
    };
    for (size_t next = 0; next < component.size(); ++next) {
      const int64_t node = component[next];
      if (linked(node, PatchLattice::kLinkRight)) visit(node + 1);
      if (linked(node, PatchLattice::kLinkDown)) visit(node + columns);
      if (node % columns > 0 && linked(node - 1, PatchLattice::kLinkRight)) visit(node - 1);
      if (node >= columns && linked(node - columns, PatchLattice::kLinkDown)) visit(node - columns);
    }
    if (static_cast<int64_t>(component.size()) >= min_patches) continue;
    removed += static_cast<int64_t>(component.size());
    for (const int64_t node : component) ClearNode(node, surface);
  }
  return removed;
}

}  // namespace meshwright
