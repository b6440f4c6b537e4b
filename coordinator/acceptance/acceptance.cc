// SPDX-License-Identifier: Apache-2.0
#include "coordinator/acceptance/acceptance.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "common/base/check.h"
#include "common/base/out_of_range.h"
#include "common/base/status_macros.h"
#include "common/geometry/level_of_detail.h"
#include "coordinator/acceptance/support_index.h"

namespace meshwright {
namespace {

constexpr int64_t kRowsPerPiece = 8;
// How much coarser than the reference a supporter's own spacing may make the ball.
constexpr double kMaxCoarseness = 2;
// A surface this many support radii behind a patch contradicts it.
constexpr double kClearanceInRadii = 2;
// A supporter that sees a place finer counts for more in its depth, by the square of this at most.
constexpr double kMaxFineness = 2;

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

// How far a patch moves along its ray so that it lies where all cameras measured it on average.
struct Move {
  float sum = 0;     // weighted, in scene units of depth
  float weight = 0;  // of the other cameras; the patch itself has 1
};

// Adds where the supporter measured a patch. Its weight falls with its distance, so that nothing jumps where the
// supporter sees another surface, and with the square of its spacing. `direction`: of the patch's ray, for a unit of
// depth; `coarseness`: d_s(X) over d_r(X).
void AddTo(Move& move, const SupportIndex& supporter, const Eigen::Vector3d& x_in_supporter,
           const Eigen::Vector3d& direction_in_supporter, double radius, double coarseness) {
  const std::optional<double> distance = supporter.DistanceAlong(x_in_supporter, direction_in_supporter, radius);
  if (!distance.has_value()) return;
  const double share = *distance / radius;
  const double likeness = (1 - share * share) * (1 - share * share);
  const double fineness = std::min(kMaxFineness, 1 / coarseness);
  const double weight = fineness * fineness * likeness;
  move.sum += static_cast<float>(weight * *distance);
  move.weight += static_cast<float>(weight);
}

// Adds one supporter's votes on what is still open, where `remaining` cameras vote, this one included; and, unless
// `moves` is null, where it measured each patch.
void CountVotesAndMoves(const PatchLattice& filtered, const SupportIndex& index, int remaining,
                        const AcceptanceOptions& options, std::vector<Votes>& votes, std::vector<Move>* moves,
                        ThreadPool& pool) {
  const SparseSurface& supporter = index.surface();
  const Camera& reference = filtered.camera;
  const Rigid3 supporter_from_reference = supporter.camera.cam_from_world * Inverse(reference.cam_from_world);
  const Lattice& lattice = filtered.lattice;
  pool.ParallelFor(lattice.rows, kRowsPerPiece, [&](int64_t begin, int64_t end) {
    for (int row = static_cast<int>(begin); row < end; ++row) {
      for (int column = 0; column < lattice.columns; ++column) {
        const auto node = static_cast<size_t>(lattice.Index(column, row));
        if (!(filtered.depth[node] > 0)) continue;
        const bool is_open = IsOpen(votes[node], remaining, options);
        if (!is_open && moves == nullptr) continue;
        const double z = filtered.depth[node];
        const Eigen::Vector3d ray = reference.RayInCam(lattice.PixelX(column) + 0.5, lattice.PixelY(row) + 0.5);
        const Eigen::Vector3d x_in_supporter = supporter_from_reference * (z * ray);
        const double detail = LevelOfDetail(reference, z, lattice.step);
        const double coarser = LevelOfDetail(supporter.camera, x_in_supporter.z(), supporter.lattice.step);
        const double radius =
            options.support_radius_steps * std::max(detail, std::min(coarser, kMaxCoarseness * detail));
        if (moves != nullptr) {
          AddTo((*moves)[node], index, x_in_supporter, supporter_from_reference.rotation * ray, radius,
                coarser / detail);
        }
        if (!is_open) continue;
        if (index.HasPatchNear(x_in_supporter, radius, filtered.IsInferred(static_cast<int64_t>(node)))) {
          votes[node].support = OneMore(votes[node].support);
        } else if (index.SeesThrough(x_in_supporter, kClearanceInRadii * radius)) {
          votes[node].conflicts = OneMore(votes[node].conflicts);
        }
      }
    }
  });
}

// `moves`: null when nobody wants to know.
absl::StatusOr<std::vector<Votes>> CollectVotes(const PatchLattice& filtered, int supporters, const SurfaceLoader& load,
                                                const AcceptanceOptions& options, std::vector<Move>* moves,
                                                ThreadPool& pool) {
  std::vector<Votes> votes(filtered.depth.size());
  for (int i = 0; i < supporters; ++i) {
    MW_ASSIGN_OR_RETURN(const std::shared_ptr<const SparseSurface> supporter, load(i));
    MW_CHECK(supporter != nullptr && supporter->camera_index != filtered.camera_index);
    CountVotesAndMoves(filtered, SupportIndex(*supporter), supporters - i, options, votes, moves, pool);
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
  MW_ASSIGN_OR_RETURN(const std::vector<Votes> votes, CollectVotes(filtered, supporters, load, options, nullptr, pool));
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
  std::vector<Move> moves(filtered.depth.size());
  MW_ASSIGN_OR_RETURN(const std::vector<Votes> votes, CollectVotes(filtered, supporters, load, options, &moves, pool));
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
  for (size_t node = 0; node < moves.size(); ++node) {
    const float move = moves[node].sum / (1 + moves[node].weight);
    if (surface.kept.depth[node] > 0) surface.kept.depth[node] += move;
    if (surface.late.depth[node] > 0) surface.late.depth[node] += move;
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
