// SPDX-License-Identifier: Apache-2.0
#include "worker/camera_job/smaller_photographs.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>

#include "worker/filtering/filtering.h"
#include "worker/filtering/refinement.h"
#include "worker/growing/growing.h"
#include "worker/photo_consistency/halved_view.h"
#include "worker/seeding/seeding.h"

namespace meshwright {
namespace {

// On smaller photographs chance agrees more easily: growing asks for more.
constexpr double kMinQuality = 0.7;
// What borders a hole is a seed of what is in it when its windows agree this well on the smaller photographs too.
constexpr float kMinBorderQuality = 0.5F;
// In pixels of the smaller photograph depths have to be more certain by this factor, each time it is halved.
constexpr double kMoreCertain = 3;
// In front of everything: nothing is looked for on such a ray.
constexpr float kClosedDepth = 1e-6F;

JobView Halved(const JobView& view) {
  const ScoredView half = Halved(ScoredView{view.camera, view.grey});
  return {view.camera_index, half.camera, half.grey};
}

// A plane as the pixels of the photograph halved see it, and back: its slope is per pixel.
PatchPlane OnHalved(const PatchPlane& plane) { return {plane.w, 2 * plane.gx, 2 * plane.gy}; }
PatchPlane OnFull(const PatchPlane& plane) { return {plane.w, plane.gx / 2, plane.gy / 2}; }

class SmallerJob {
 public:
  SmallerJob(const CameraJobInput& input, const PatchScorer& full_scorer, const CameraJobOptions& options,
             const SurfaceEstimate& surface)
      : input_(input), full_scorer_(full_scorer), options_(options), surface_(surface) {
    half_.reference = Halved(input.reference);
    for (const JobView& target : input.targets) half_.targets.push_back(Halved(target));
    half_.sparse_points = input.sparse_points;
    half_.sparse_points_seen_by = input.sparse_points_seen_by;
    half_.region = input.region;
    half_.accepted = AcceptedDepth::Empty(half_.reference.camera, options.lattice_step);
    CloseWhatIsKnown();
  }

  std::vector<PatchPlane> Run(int64_t& scored, ThreadPool& pool) {
    const PatchScorer scorer = MakeScorer(half_, options_.scoring);
    std::vector<Seed> seeds =
        FindSeeds(scorer, ObservationsOf(half_), half_.accepted, half_.accepted.lattice, options_.seeding, pool).seeds;
    AddBorder(scorer, seeds);
    GrowingOptions growing = options_.growing;
    growing.min_quality = std::max(growing.min_quality, kMinQuality);
    const PatchStacks grown = Grow(scorer, seeds, half_.accepted, growing, pool);
    scored += grown.tentative_patches_scored;

    CameraJobOptions next = options_;
    next.filtering.refinement.max_uncertainty_px /= kMoreCertain;
    --next.halvings;
    FilteringResult filtering = FilterPatches(grown, half_.reference.camera, next.filtering, pool);
    PatchScorer::Options fine_scoring = options_.scoring;
    fine_scoring.window_radius = next.filtering.refinement.window_radius;
    scored += RefineSurface(MakeScorer(half_, fine_scoring), next.filtering.refinement, filtering.surface, pool);
    std::vector<PatchPlane> found = GrowOnSmallerPhotographs(half_, scorer, next, filtering.surface, scored, pool);
    for (size_t i = 0; i < found.size(); ++i) {
      if (filtering.surface.plane[i].w > 0) found[i] = filtering.surface.plane[i];
    }
    return AtFullSize(found);
  }

 private:
  bool IsOpen(int64_t node) const {
    return !surface_.HasPatch(node) && !(input_.accepted.depth[static_cast<size_t>(node)] > 0);
  }

  Eigen::Vector2d Pixel(int64_t node) const {
    return surface_.lattice.Pixel(static_cast<int>(node % surface_.lattice.columns),
                                  static_cast<int>(node / surface_.lattice.columns));
  }

  // The ray of the smaller lattice nearest to one of the full lattice; -1: beyond its last.
  int64_t NearestSmaller(int64_t node) const {
    const Lattice& smaller = half_.accepted.lattice;
    const Eigen::Vector2d at = smaller.FromPixel(Pixel(node) / 2);
    const auto column = static_cast<int>(std::lround(at.x()));
    const auto row = static_cast<int>(std::lround(at.y()));
    return smaller.Contains(column, row) ? smaller.Index(column, row) : -1;
  }

  // By how much a ray of the smaller lattice is away from one of the full lattice, px of the smaller photograph.
  Eigen::Vector2f FromSmaller(int64_t smaller_node, int64_t node) const {
    const Lattice& smaller = half_.accepted.lattice;
    const Eigen::Vector2d from = smaller.Pixel(static_cast<int>(smaller_node % smaller.columns),
                                               static_cast<int>(smaller_node / smaller.columns));
    return (Pixel(node) / 2 - from).cast<float>();
  }

  // Only rays beside a hole, or in one, are open. `border_`: a patch on each of them that has one.
  void CloseWhatIsKnown() {
    std::vector<float>& depth = half_.accepted.depth;
    depth.assign(depth.size(), kClosedDepth);
    border_.assign(depth.size(), -1);
    for (int64_t node = 0; node < surface_.lattice.nodes(); ++node) {
      const int64_t smaller = NearestSmaller(node);
      if (smaller < 0) continue;
      if (IsOpen(node)) depth[static_cast<size_t>(smaller)] = 0;
      if (surface_.HasPatch(node) && border_[static_cast<size_t>(smaller)] < 0) {
        border_[static_cast<size_t>(smaller)] = node;
      }
    }
  }

  void AddBorder(const PatchScorer& scorer, std::vector<Seed>& seeds) const {
    const Lattice& smaller = half_.accepted.lattice;
    PatchScorer::Window window;
    for (int64_t at = 0; at < smaller.nodes(); ++at) {
      const int64_t node = border_[static_cast<size_t>(at)];
      if (node < 0 || half_.accepted.depth[static_cast<size_t>(at)] > 0) continue;
      const Eigen::Vector2f back = -FromSmaller(at, node);
      const uint32_t sigma = surface_.sigma[static_cast<size_t>(node)];
      const PatchPlane plane = OnHalved(surface_.plane[static_cast<size_t>(node)]).MovedBy(back.x(), back.y());
      const int x = smaller.PixelX(static_cast<int>(at % smaller.columns));
      const int y = smaller.PixelY(static_cast<int>(at / smaller.columns));
      scorer.MakeWindow(x, y, window);
      const float quality = scorer.MeanScore(window, x, y, plane, sigma);
      if (quality < kMinBorderQuality) continue;
      seeds.push_back({.node = static_cast<int32_t>(at), .plane = plane, .sigma = sigma, .quality = quality});
    }
  }

  std::vector<PatchPlane> AtFullSize(const std::vector<PatchPlane>& found) const {
    std::vector<PatchPlane> planes(surface_.plane.size());
    PatchScorer::Window window;
    for (int64_t node = 0; node < surface_.lattice.nodes(); ++node) {
      const int64_t smaller = IsOpen(node) ? NearestSmaller(node) : -1;
      if (smaller < 0 || !(found[static_cast<size_t>(smaller)].w > 0)) continue;
      const Eigen::Vector2f moved = FromSmaller(smaller, node);
      const PatchPlane plane = OnFull(found[static_cast<size_t>(smaller)].MovedBy(moved.x(), moved.y()));
      const Eigen::Vector2d pixel = Pixel(node);
      full_scorer_.MakeWindow(static_cast<int>(pixel.x()), static_cast<int>(pixel.y()), window);
      const bool may_be = window.may_hold_surface && !window.may_show_backdrop && plane.w > 0 &&
                          plane.w >= window.min_w && plane.w <= window.max_w;
      if (may_be) planes[static_cast<size_t>(node)] = plane;
    }
    return planes;
  }

  const CameraJobInput& input_;
  const PatchScorer& full_scorer_;
  const CameraJobOptions& options_;
  const SurfaceEstimate& surface_;
  CameraJobInput half_;
  std::vector<int64_t> border_;
};

}  // namespace

std::vector<PatchPlane> GrowOnSmallerPhotographs(const CameraJobInput& input, const PatchScorer& scorer,
                                                 const CameraJobOptions& options, const SurfaceEstimate& surface,
                                                 int64_t& scored, ThreadPool& pool) {
  const auto can_be_halved = [](const JobView& view) { return view.grey->level_count() > 1; };
  const bool goes_on = options.halvings > 0 && can_be_halved(input.reference) && !input.targets.empty() &&
                       std::all_of(input.targets.begin(), input.targets.end(), can_be_halved);
  if (!goes_on) return std::vector<PatchPlane>(surface.plane.size());
  return SmallerJob(input, scorer, options, surface).Run(scored, pool);
}

}  // namespace meshwright
