// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>
#include <absl/status/status.h>

#include "common/base/thread_pool.h"
#include "common/surface/lattice.h"
#include "worker/photo_consistency/patch_scorer.h"
#include "worker/visibility/accepted_depth.h"

namespace meshwright {

// Section 3.5 of Jancosek et al. 2009.
struct SeedingOptions {
  double min_apical_angle_deg = 3;  // alpha_S, degrees, 0..60
  int min_seeds_per_pair = 10;      // m_S; pairs with fewer are removed from the incidence matrix, >= 0
  double min_quality = 0.7;         // photo-consistency that a seed must reach, -1..1

  absl::Status Validate() const;
};

// A seed patch on a ray of the reference lattice.
struct Seed {
  int32_t node = 0;    // lattice index
  PatchPlane plane;    // inverse depth at the node and its slope
  uint32_t sigma = 0;  // bit i: target i sees it
  float quality = 0;   // mean NCC over sigma
};

struct SparsePointObservation {
  Eigen::Vector3d x_in_world = Eigen::Vector3d::Zero();
  uint32_t seen_by = 0;  // bit i: target i observed it
};

struct SeedingResult {
  std::vector<Seed> seeds;                // sorted by (node, inverse depth), at most 3 on a node
  std::vector<int64_t> seeds_per_target;  // how many seeds see target i
  // What m_S is to be compared with: seeds that see target i, and corners on the accepted surface on which target i
  // agrees with the reference. Where everything is reconstructed already, few seeds do not mean a bad pair.
  std::vector<int64_t> matches_per_target;
  int64_t seeds_from_points = 0;

  int64_t corners = 0;              // Harris corners of the reference
  int64_t corners_covered = 0;      // explained by the accepted surface, no seed needed
  int64_t points_covered = 0;       // sparse points on or behind the accepted surface
  int64_t points_inconsistent = 0;  // sparse points whose patch did not reach min_quality
};

// Seeds from sparse points and from Harris corners of the reference matched along epipolar lines to those of every
// target. Nothing behind `accepted`, or within 3 d_r of it, is seeded. `accepted` is over the same `lattice`; at most
// 32 targets. The result depends neither on the number of threads nor on the order of `points`.
SeedingResult FindSeeds(const PatchScorer& scorer, const std::vector<SparsePointObservation>& points,
                        const AcceptedDepth& accepted, const Lattice& lattice, const SeedingOptions& options,
                        ThreadPool& pool);

}  // namespace meshwright
