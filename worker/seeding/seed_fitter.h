// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "common/surface/lattice.h"
#include "worker/photo_consistency/patch_scorer.h"
#include "worker/seeding/epipolar.h"
#include "worker/seeding/seeding.h"
#include "worker/visibility/accepted_depth.h"

namespace meshwright {

// NCC with which a target is taken to see a seed: the photo-consistency that growing asks for (section 3.6).
constexpr float kMinTargetNcc = 0.6F;

// Turns a rough plane near a pixel into a seed on the nearest lattice node. Holds what all seeds of one reference
// share; references must outlive it. Thread-safe.
class SeedFitter {
 public:
  enum class Outcome {
    kSeed,
    kHidden,        // on or behind the accepted surface
    kInconsistent,  // too low a photo-consistency, or no texture
  };

  // A lattice node as scoring sees it.
  struct Node {
    int32_t index = 0;  // in the lattice
    int x = 0;          // px
    int y = 0;
    PatchScorer::Window window;
  };

  SeedFitter(const PatchScorer& scorer, const AcceptedDepth& accepted, const Lattice& lattice,
             const SeedingOptions& options);

  const PatchScorer& scorer() const { return scorer_; }
  const EpipolarGeometry& epipolar(int target) const { return epipolar_[static_cast<size_t>(target)]; }

  // The node nearest to the pixel.
  Node NodeAt(int x, int y) const;

  // Smallest inverse depth at the node that lies clearly (3 d_r) in front of the accepted surface; 0 without one.
  float MinInverseDepth(int32_t node) const;
  // The accepted surface at the node, if there is one.
  std::optional<PatchPlane> AcceptedPlane(int32_t node) const;

  // Targets that have the point at inverse depth w of the pixel's ray in front of them and in their image, under an
  // apical angle that allows it to be measured. Bit i for target i.
  uint32_t TargetsFor(int x, int y, float w) const;
  // Those of `targets` whose NCC with the plane is at least `min_ncc`. Adds up to `sum` their NCCs.
  uint32_t TargetsThatAgree(const Node& node, const PatchPlane& plane, uint32_t targets, float min_ncc,
                            float& sum) const;

  // The at most `count` best of them.
  uint32_t BestTargets(const Node& node, const PatchPlane& plane, uint32_t targets, float min_ncc, int count) const;

  // `plane`: at the node. Refines it with the targets that agree roughly and keeps those that agree well then. Of the
  // four windows beside the seed's at least `min_continued` must match through its plane too: what matches by chance
  // does not go on.
  Outcome Fit(const Node& node, const PatchPlane& plane, int min_continued, Seed& seed) const;

 private:
  int CountContinued(const Node& node, const PatchPlane& plane, uint32_t sigma) const;

  const PatchScorer& scorer_;
  const AcceptedDepth& accepted_;
  const Lattice& lattice_;
  const SeedingOptions& options_;
  std::vector<EpipolarGeometry> epipolar_;
};

}  // namespace meshwright
