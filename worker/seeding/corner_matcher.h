// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "common/base/thread_pool.h"
#include "worker/seeding/harris.h"
#include "worker/seeding/pixel_index.h"
#include "worker/seeding/plane_search.h"
#include "worker/seeding/seed_fitter.h"

namespace meshwright {

// A corner of a target that may show a corner of the reference.
struct CornerMatch {
  PatchPlane plane;  // at the reference's corner
  float ncc = 0;
  int target = 0;
};

// Matches of one corner in several targets that agree on its depth.
struct CornerHypothesis {
  CornerMatch best;
  float support = 0;  // sum over targets of the best NCC
};

// Finds the corners of all targets that lie on a reference corner's epipolar lines and look like it (section 3.5). The
// fitter must outlive it. Thread-safe.
class CornerMatcher {
 public:
  // Depths are looked for within 1 / max_w .. 1 / min_w.
  CornerMatcher(const SeedFitter& fitter, double min_w, double max_w, ThreadPool& pool);

  // Hypotheses on the corner's depth with inverse depth above `min_w`, best supported first. `window`: the reference's
  // around the corner. `prior`: a slope to be tried beside the facing and the tilted ones.
  std::vector<CornerHypothesis> Match(const Corner& corner, const PatchScorer::Window& window, double min_w,
                                      const std::optional<RelativeSlope>& prior) const;

 private:
  std::vector<CornerMatch> FindMatches(const Corner& corner, const PatchScorer::Window& window, double min_w,
                                       const std::optional<RelativeSlope>& prior) const;
  std::vector<CornerHypothesis> Group(const Corner& corner, std::vector<CornerMatch> matches) const;

  const SeedFitter& fitter_;
  const PatchScorer& scorer_;
  double min_w_;
  double max_w_;
  std::vector<PixelIndex> target_corners_;
};

}  // namespace meshwright
