// SPDX-License-Identifier: Apache-2.0
#include "worker/completion/completion.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <optional>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "common/base/check.h"
#include "common/base/out_of_range.h"
#include "common/surface/lattice_sight.h"

namespace meshwright {
namespace {

constexpr int kRowsPerPiece = 4;

constexpr int kDirections = LatticeSight::kDirections;
// So many of them must meet the plane; where the picture ends it could go on, but not in most of them.
constexpr int kMinOnPlane = 10;
constexpr int kMinOnPlaneAtRim = 6;
// Nor may so many side by side miss it: sky ends with the picture too, and has its roofs on one side.
constexpr int kMaxMissingSideBySide = 5;
// Three directions that are at least so many apart span a plane well.
constexpr int kMinApart = 4;
// What lies on the plane, in lattice steps d_r.
constexpr float kTolerance = 1.5F;
// Surface that so many of the eight neighbours continue within so many d_r can be built on; crumbs cannot.
constexpr int kMinContinued = 5;
constexpr float kContinuedWithin = 3;
// Behind the first patch that a direction meets, so many more take part in the fit: the rim of a surface is its worst.
constexpr int kBehindRim = 4;
// A window with more contrast, grey levels, was not blind: what it was compared with did not agree.
constexpr float kMaxTexture = 2;
// What rays around have inferred is averaged this far around, lattice steps.
constexpr int kSmoothingRadius = 5;

class Completer {
 public:
  Completer(const PatchScorer& scorer, const AcceptedDepth& accepted, const CompletionOptions& options,
            const SurfaceEstimate& surface)
      : scorer_(scorer),
        lattice_(surface.lattice),
        reach_(static_cast<int>(options.max_reach * std::max(lattice_.columns, lattice_.rows))),
        footprint_(static_cast<float>(lattice_.step) / static_cast<float>(scorer.reference().focal())) {
    FindSurroundings(surface, accepted);
    for (int a = 0; a < kDirections; ++a) {
      for (int b = a + kMinApart; b < kDirections; ++b) {
        for (int c = b + kMinApart; c < kDirections && c - a <= kDirections - kMinApart; ++c) {
          triples_.push_back({a, b, c});
        }
      }
    }
  }

  // The plane around a hole's node, if there is one.
  std::optional<PatchPlane> PlaneAround(int column, int row) const {
    const int x = lattice_.PixelX(column);
    const int y = lattice_.PixelY(row);
    PatchScorer::Window window;
    scorer_.MakeWindow(x, y, window);
    if (!window.may_hold_surface || window.may_show_backdrop || window.sigma > kMaxTexture) return std::nullopt;
    std::array<Hit, kDirections> hits;
    int count = 0;
    int leave_picture = 0;
    for (int direction = 0; direction < kDirections; ++direction) {
      hits[static_cast<size_t>(direction)] = Look(column, row, direction);
      if (hits[static_cast<size_t>(direction)].w > 0) {
        ++count;
      } else if (LeavesPicture(column, row, direction)) {
        ++leave_picture;
      }
    }
    const int min_on_plane = std::max(kMinOnPlane - leave_picture, kMinOnPlaneAtRim);
    if (count < min_on_plane) return std::nullopt;
    const std::optional<PatchPlane> plane = PlaneOfMost(hits, min_on_plane);
    if (!plane.has_value() || !Surrounds(*plane, hits)) return std::nullopt;
    const std::optional<PatchPlane> fit = Fit(column, row, hits, *plane);
    if (!fit.has_value() || fit->w < window.min_w || fit->w > window.max_w) return std::nullopt;
    return fit;
  }

 private:
  struct Hit {
    int steps = 0;  // of kStep
    float dx = 0;   // px from the ray
    float dy = 0;
    float w = 0;  // 0: nothing within reach
  };

  bool IsOn(const PatchPlane& plane, float dx, float dy, float w) const {
    return std::fabs(plane.MovedBy(dx, dy).w - w) <= kTolerance * footprint_ * w;
  }

  void FindSurroundings(const SurfaceEstimate& surface, const AcceptedDepth& accepted) {
    const auto nodes = static_cast<size_t>(lattice_.nodes());
    std::vector<float> all(nodes, 0.0F);
    for (size_t i = 0; i < nodes; ++i) {
      if (surface.plane[i].w > 0) {
        all[i] = surface.plane[i].w;
      } else if (accepted.depth[i] > 0) {
        all[i] = 1.0F / accepted.depth[i];
      }
    }
    around_w_.assign(nodes, 0.0F);
    std::vector<uint8_t> has_surface(nodes, 0);
    for (int row = 0; row < lattice_.rows; ++row) {
      for (int column = 0; column < lattice_.columns; ++column) {
        const auto i = static_cast<size_t>(lattice_.Index(column, row));
        if (!(all[i] > 0)) continue;
        int continued = 0;
        for (int dy = -1; dy <= 1; ++dy) {
          for (int dx = -1; dx <= 1; ++dx) {
            if ((dx == 0 && dy == 0) || !lattice_.Contains(column + dx, row + dy)) continue;
            const float w = all[static_cast<size_t>(lattice_.Index(column + dx, row + dy))];
            if (w > 0 && std::fabs(w - all[i]) <= kContinuedWithin * footprint_ * all[i]) ++continued;
          }
        }
        if (continued < kMinContinued) continue;
        around_w_[i] = all[i];
        has_surface[i] = 1;
      }
    }
    sight_.emplace(lattice_, has_surface);
  }

  // The nearest surface in one direction.
  Hit Look(int column, int row, int direction) const {
    const int steps = sight_->StepsTo(column, row, direction, reach_);
    if (steps == 0) return {};
    const auto& [dx, dy] = LatticeSight::kStep[static_cast<size_t>(direction)];
    return {steps, static_cast<float>(steps * dx * lattice_.step), static_cast<float>(steps * dy * lattice_.step),
            around_w_[static_cast<size_t>(lattice_.Index(column + steps * dx, row + steps * dy))]};
  }

  // Whether the picture ends within reach.
  bool LeavesPicture(int column, int row, int direction) const {
    const auto& [dx, dy] = LatticeSight::kStep[static_cast<size_t>(direction)];
    const int steps = reach_ / std::max(std::abs(dx), std::abs(dy));
    return !lattice_.Contains(column + steps * dx, row + steps * dy);
  }

  // The plane through three of the hits that most of them lie on, at least `min_on_plane`; of equals the one they are
  // closest to.
  std::optional<PatchPlane> PlaneOfMost(const std::array<Hit, kDirections>& hits, int min_on_plane) const {
    std::optional<PatchPlane> best;
    int most = min_on_plane - 1;
    float least_error = 0;
    for (const auto& [ia, ib, ic] : triples_) {
      const Hit& a = hits[static_cast<size_t>(ia)];
      const Hit& b = hits[static_cast<size_t>(ib)];
      const Hit& c = hits[static_cast<size_t>(ic)];
      if (!(a.w > 0) || !(b.w > 0) || !(c.w > 0)) continue;
      const Eigen::Vector2f ab(b.dx - a.dx, b.dy - a.dy);
      const Eigen::Vector2f ac(c.dx - a.dx, c.dy - a.dy);
      const float determinant = ab.x() * ac.y() - ab.y() * ac.x();
      if (std::fabs(determinant) < kMinArea * (ab.squaredNorm() + ac.squaredNorm())) continue;
      const float gx = ((b.w - a.w) * ac.y() - (c.w - a.w) * ab.y()) / determinant;
      const float gy = ((c.w - a.w) * ab.x() - (b.w - a.w) * ac.x()) / determinant;
      const PatchPlane plane{a.w - gx * a.dx - gy * a.dy, gx, gy};
      int on = 0;
      float error = 0;
      for (const Hit& hit : hits) {
        if (!(hit.w > 0) || !IsOn(plane, hit.dx, hit.dy, hit.w)) continue;
        ++on;
        error += std::fabs(plane.MovedBy(hit.dx, hit.dy).w - hit.w);
      }
      if (on > most || (on == most && best.has_value() && error < least_error)) {
        best = plane;
        most = on;
        least_error = error;
      }
    }
    return best;
  }

  // Whether the plane is met on all sides.
  bool Surrounds(const PatchPlane& plane, const std::array<Hit, kDirections>& hits) const {
    int missing = 0;
    for (int direction = 0; direction < 2 * kDirections; ++direction) {
      const Hit& hit = hits[static_cast<size_t>(direction % kDirections)];
      missing = hit.w > 0 && IsOn(plane, hit.dx, hit.dy, hit.w) ? 0 : missing + 1;
      if (missing > kMaxMissingSideBySide) return false;
    }
    return true;
  }

  // The least-squares plane through the hits that lie on `plane` and what lies behind them; the nearer, the more
  // they count.
  std::optional<PatchPlane> Fit(int column, int row, const std::array<Hit, kDirections>& hits,
                                const PatchPlane& plane) const {
    Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
    Eigen::Vector3d right = Eigen::Vector3d::Zero();
    for (int direction = 0; direction < kDirections; ++direction) {
      const Hit& hit = hits[static_cast<size_t>(direction)];
      if (!(hit.w > 0)) continue;
      const double weight = 1.0 / std::hypot(hit.dx, hit.dy);
      for (int k = 0; k <= kBehindRim; ++k) {
        const int dx = (hit.steps + k) * LatticeSight::kStep[static_cast<size_t>(direction)][0];
        const int dy = (hit.steps + k) * LatticeSight::kStep[static_cast<size_t>(direction)][1];
        if (!lattice_.Contains(column + dx, row + dy)) break;
        const float w = around_w_[static_cast<size_t>(lattice_.Index(column + dx, row + dy))];
        const auto dx_px = static_cast<float>(dx * lattice_.step);
        const auto dy_px = static_cast<float>(dy * lattice_.step);
        if (!(w > 0) || !IsOn(plane, dx_px, dy_px, w)) break;
        const Eigen::Vector3d v(1, dx_px, dy_px);
        normal += weight * v * v.transpose();
        right += weight * w * v;
      }
    }
    const Eigen::Vector3f fit = normal.ldlt().solve(right).cast<float>();
    if (!fit.allFinite() || !(fit[0] > 0)) return std::nullopt;
    return PatchPlane{fit[0], fit[1], fit[2]};
  }

  static constexpr float kMinArea = 0.1F;  // of the triangle of three hits, beside its sides' squares

  const PatchScorer& scorer_;
  const Lattice& lattice_;
  const int reach_;              // lattice steps
  const float footprint_;        // d_r in inverse depth, per inverse depth
  std::vector<float> around_w_;  // per node: inverse depth, 0 where there is nothing to build on
  std::optional<LatticeSight> sight_;
  std::vector<std::array<int, 3>> triples_;
};

// Each ray meets other rims, so their planes differ where they are one. Planes in the place of inferred patches, for
// `row`: the mean of those around that agree.
void SmoothRow(const std::vector<PatchPlane>& inferred, const Lattice& lattice, float footprint, int row,
               std::vector<PatchPlane>& smooth) {
  for (int column = 0; column < lattice.columns; ++column) {
    const auto node = static_cast<size_t>(lattice.Index(column, row));
    const PatchPlane& own = inferred[node];
    if (!(own.w > 0)) continue;
    Eigen::Vector3f sum = Eigen::Vector3f::Zero();
    float count = 0;
    for (int dy = -kSmoothingRadius; dy <= kSmoothingRadius; ++dy) {
      for (int dx = -kSmoothingRadius; dx <= kSmoothingRadius; ++dx) {
        if (!lattice.Contains(column + dx, row + dy)) continue;
        const PatchPlane& other = inferred[static_cast<size_t>(lattice.Index(column + dx, row + dy))];
        if (!(other.w > 0)) continue;
        const PatchPlane here =
            other.MovedBy(static_cast<float>(-dx * lattice.step), static_cast<float>(-dy * lattice.step));
        if (std::fabs(here.w - own.w) > 2 * kTolerance * footprint * own.w) continue;
        sum += Eigen::Vector3f(here.w, here.gx, here.gy);
        ++count;
      }
    }
    sum /= count;
    smooth[node] = {sum[0], sum[1], sum[2]};
  }
}

// Links inferred patches with each other and with what surrounds them, where one continues the other.
void LinkInferred(const std::vector<uint8_t>& is_inferred, float footprint, SurfaceEstimate& surface) {
  constexpr float kMaxPlaneDistance = 2;  // d_r
  const Lattice& lattice = surface.lattice;
  const auto continues = [&](int64_t a, int64_t b, float dx, float dy) {
    if (!surface.HasPatch(a) || !surface.HasPatch(b)) return false;
    if (is_inferred[static_cast<size_t>(a)] == 0 && is_inferred[static_cast<size_t>(b)] == 0) return false;
    const PatchPlane& p = surface.plane[static_cast<size_t>(a)];
    const PatchPlane& q = surface.plane[static_cast<size_t>(b)];
    const float apart = std::fabs(q.w - p.MovedBy(dx, dy).w) + std::fabs(p.w - q.MovedBy(-dx, -dy).w);
    return 0.5F * apart <= kMaxPlaneDistance * footprint * std::max(p.w, q.w);
  };
  const auto step = static_cast<float>(lattice.step);
  for (int row = 0; row < lattice.rows; ++row) {
    for (int column = 0; column < lattice.columns; ++column) {
      const int64_t node = lattice.Index(column, row);
      uint8_t& links = surface.links[static_cast<size_t>(node)];
      if (column + 1 < lattice.columns && continues(node, node + 1, step, 0)) links |= PatchLattice::kLinkRight;
      if (row + 1 < lattice.rows && continues(node, node + lattice.columns, 0, step)) links |= PatchLattice::kLinkDown;
    }
  }
}

}  // namespace

absl::Status CompletionOptions::Validate() const {
  if (!(max_reach >= 0 && max_reach <= 1)) return OutOfRange("completion.max_reach", max_reach, "0..1");
  return absl::OkStatus();
}

int64_t CompleteSurface(const PatchScorer& scorer, const AcceptedDepth& accepted, const std::vector<PatchPlane>& found,
                        const CompletionOptions& options, SurfaceEstimate& surface, ThreadPool& pool) {
  const Lattice& lattice = surface.lattice;
  MW_CHECK(accepted.depth.size() == surface.plane.size());
  MW_CHECK(found.size() == surface.plane.size());
  const Completer completer(scorer, accepted, options, surface);
  const float footprint = static_cast<float>(lattice.step) / static_cast<float>(scorer.reference().focal());
  const auto over_rows = [&](const auto& body) {
    pool.ParallelFor(lattice.rows, kRowsPerPiece, [&](int64_t begin, int64_t end) {
      for (auto row = static_cast<int>(begin); row < end; ++row) body(row);
    });
  };
  std::vector<PatchPlane> inferred(surface.plane.size());
  if (options.max_reach > 0) {
    std::vector<PatchPlane> rough(surface.plane.size());
    over_rows([&](int row) {
      for (int column = 0; column < lattice.columns; ++column) {
        const auto node = static_cast<size_t>(lattice.Index(column, row));
        if (surface.plane[node].w > 0 || accepted.depth[node] > 0 || found[node].w > 0) continue;
        rough[node] = completer.PlaneAround(column, row).value_or(PatchPlane{});
      }
    });
    over_rows([&](int row) { SmoothRow(rough, lattice, footprint, row, inferred); });
  }
  std::vector<uint8_t> is_inferred(inferred.size(), 0);
  int64_t count = 0;
  for (size_t node = 0; node < inferred.size(); ++node) {
    if (!(surface.plane[node].w > 0) && !(accepted.depth[node] > 0) && found[node].w > 0) inferred[node] = found[node];
    if (!(inferred[node].w > 0)) continue;
    surface.plane[node] = inferred[node];
    is_inferred[node] = 1;
    ++count;
  }
  LinkInferred(is_inferred, footprint, surface);
  return count;
}

}  // namespace meshwright
