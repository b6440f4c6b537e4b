// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "common/geometry/camera.h"
#include "common/surface/patch_lattice.h"

namespace meshwright::scale {

// A long flat wall with a camera every half a unit: as many cameras as wanted, each overlapping sixteen others, and
// surfaces that are known without looking at a photograph.
class WallWorld {
 public:
  explicit WallWorld(int cameras) : cameras_(cameras) {}

  // COLMAP text with one tiny picture for all cameras. Makes the folder.
  void Write(const std::string& folder) const;

  // F_r as a worker would find it: a patch on every ray.
  static PatchLattice FilteredSurface(CameraIndex index);

 private:
  static Camera CameraAt(int index);
  int cameras_;
};

}  // namespace meshwright::scale
