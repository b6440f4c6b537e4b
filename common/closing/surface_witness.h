// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>

#include <Eigen/Core>

#include "common/surface/lattice_sight.h"
#include "common/surface/sparse_surface.h"

namespace meshwright {

// What one camera, by the surface that it has measured, can say about points, and against triangles that might close a
// gap.
class SurfaceWitness {
 public:
  // Keeps a reference to `surface`.
  explicit SurfaceWitness(const SparseSurface& surface) : surface_(surface), finder_(surface) {}

  const SparseSurface& surface() const { return surface_; }

  // Whether the camera has measured the point: on one of the four rays around it, to within `radius` (scene units) in
  // depth.
  bool Measured(const Eigen::Vector3d& x_in_world, double radius) const;

  // How many rays pass the triangle and end at surface, measured or inferred, well behind it.
  int64_t CountLooksThrough(const std::array<Eigen::Vector3d, 3>& triangle_in_world) const;

  // Depth at a node of the lattice; 0: nothing measured.
  double DepthAt(int column, int row) const;

 private:
  const SparseSurface& surface_;
  const PatchFinder finder_;
};

// What it can say for them.
class GapWitness {
 public:
  // `reach`: how large a gap is looked at, as a share of the photograph's longer side. Keeps a reference to `witness`.
  GapWitness(const SurfaceWitness& witness, double reach);

  // Whether the camera looks at the triangle's front, at an angle that shows something, with no surface before it; the
  // triangle is not too large; and in nearly all directions around it the camera sees surface, so that it lies in a gap
  // and not beyond a rim.
  bool Vouches(const std::array<Eigen::Vector3d, 3>& triangle_in_world) const;

 private:
  const SurfaceWitness& witness_;
  const LatticeSight sight_;
  const double longest_px_;
};

}  // namespace meshwright
