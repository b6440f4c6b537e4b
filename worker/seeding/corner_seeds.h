// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "common/base/thread_pool.h"
#include "worker/seeding/seed_fitter.h"
#include "worker/seeding/seeding.h"

namespace meshwright {

struct CornerSeeds {
  std::vector<Seed> seeds;
  // Corners on the accepted surface on which target i agrees with the reference.
  std::vector<int64_t> covered_matches_per_target;
  int64_t corners = 0;          // in the reference
  int64_t covered_corners = 0;  // explained by the accepted surface
};

// Harris corners of the reference matched along epipolar lines with those of every target. A match that two targets
// confirm is taken; one that a single target shows must be good and without a rival. `known`: seeds whose planes
// are tried first for corners nearby.
CornerSeeds SeedCorners(const SeedFitter& fitter, const std::vector<Seed>& known, double min_w, double max_w,
                        const Lattice& lattice, ThreadPool& pool);

}  // namespace meshwright
