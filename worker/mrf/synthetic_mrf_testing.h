// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <random>

#include "worker/mrf/grid_mrf.h"

namespace meshwright {

// For tests and benchmarks: an energy like those that growing leaves behind. About half of the nodes have patches, most
// of these one, some up to four: noisy samples of a piecewise planar surface, of a second layer close to it, of
// coherent false surfaces, and lone outliers. Costs as in Jancosek et al. 2009, sec. 3.7, in units of d_r.
GridMrf MakeSurfaceMrf(int columns, int rows, uint32_t seed);

// Up to max_patches patches per node and pairwise costs that are random in [0, 1], +infinity with this probability, and
// otherwise as in the paper. Adversarial: nothing is coherent.
GridMrf MakeRandomMrf(int columns, int rows, int max_patches, double infinite_share, std::mt19937& random);

// Uniform in [0, 1); the same on every machine, as std::uniform_real_distribution is not.
double UniformReal(std::mt19937& random);

}  // namespace meshwright
