// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include <Eigen/Core>

#include "tools/synthetic/synthetic_scene.h"
#include "tools/synthetic/world.h"

#include "common/geometry/camera.h"

namespace meshwright {

// A world with cameras set up in it.
struct Stage {
  World world;
  std::vector<Camera> cameras;
};

Stage BuildFacade(const SyntheticOptions& options);
Stage BuildRing(const SyntheticOptions& options);
Stage BuildStreet(const SyntheticOptions& options);
Stage BuildRoom(const SyntheticOptions& options);

// A camera of the options' size at `center` with the optical axis through `target`; world up (z) is up in the picture.
Camera LookAt(const SyntheticOptions& options, double focal_px, const Eigen::Vector3d& center,
              const Eigen::Vector3d& target);

}  // namespace meshwright
