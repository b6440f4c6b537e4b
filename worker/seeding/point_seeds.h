// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "common/base/thread_pool.h"
#include "worker/seeding/seed_fitter.h"
#include "worker/seeding/seeding.h"

namespace meshwright {

struct PointSeeds {
  std::vector<Seed> seeds;  // from top to bottom of the image
  int64_t hidden = 0;
  int64_t inconsistent = 0;
};

// Seeds from sparse points in front of the reference. A point comes without a normal: facing planes, tilted ones and
// the plane through its neighbours (which alone fits surfaces seen at a grazing angle) are tried.
PointSeeds SeedPoints(const SeedFitter& fitter, const std::vector<SparsePointObservation>& points, ThreadPool& pool);

}  // namespace meshwright
