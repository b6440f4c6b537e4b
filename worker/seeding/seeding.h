#pragma once

#include <cstdint>
#include <span>
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
  double min_apical_angle_deg = 3;  // alpha_S, degrees, 0..90
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
  std::vector<Seed> seeds;                // sorted by (node, inverse depth)
  std::vector<int64_t> seeds_per_target;  // how many seeds see target i
  int64_t seeds_from_points = 0;
};

// Seeds from sparse points and from Harris corners of the reference matched along epipolar lines to those of every
// target. Nothing behind `accepted` is seeded.
SeedingResult FindSeeds(const PatchScorer& scorer, const std::vector<SparsePointObservation>& points,
                        const AcceptedDepth& accepted, const Lattice& lattice, const SeedingOptions& options,
                        ThreadPool& pool);

}  // namespace meshwright
