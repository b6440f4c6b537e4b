// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "common/base/thread_pool.h"
#include "common/surface/sparse_surface.h"

namespace meshwright {

// Where a camera may have measured anything: up to which depths (both 0: nowhere), within its picture.
struct MeasuredSpace {
  Camera camera = {};
  float nearest = 0;  // depth of its patches, scene units
  float farthest = 0;

  static MeasuredSpace Of(const SparseSurface& surface);
  // False only if no patch can lie within `radius` of x.
  bool MayReach(const Eigen::Vector3d& x_in_world, double radius) const;
};

// Where an accepted surface lies, in tiles of its lattice: little enough to keep for all surfaces at once.
class SurfaceOutline {
 public:
  explicit SurfaceOutline(const SparseSurface& surface);

  // False only if no patch of this surface lies within `margin_steps` lattice steps of `other` on other's rays.
  bool MayOverlap(const SurfaceOutline& other, double margin_steps) const;
  // The same, less exactly, from where the other one was measured.
  bool MayOverlap(const MeasuredSpace& other, const Lattice& lattice, double margin_steps) const;

  int64_t bytes() const;

 private:
  struct Ball {  // around the patches of one tile
    Eigen::Vector3f center_in_world;
    float radius;
  };
  static Ball BallAround(const std::vector<Eigen::Vector3d>& points);
  bool MayContain(const Ball& ball, double margin_steps) const;

  Camera camera_;
  Lattice lattice_;
  int tile_columns_ = 0;
  int tile_rows_ = 0;
  std::vector<float> nearest_;   // depth, per tile; 0: no patch in it
  std::vector<float> farthest_;  // depth, per tile
  std::vector<Ball> balls_;
  Ball around_all_ = {};
};

// Per patch: it is the corner of a triangle.
std::vector<bool> CornersOfTriangles(const SparseSurface& surface);

// Marks in `removed` (one entry per patch of `surface`) each patch that `cover` shows too: the node of `cover` nearest
// to its projection is the corner of a triangle (`in_triangle`, as CornersOfTriangles says), its plane passes within
// `margin_steps` d of the patch (d of section 3.3, Jancosek et al. 2009, the coarser one), and the normals differ by
// less than 60 degrees. Both sides of a thin wall stay.
void MarkCovered(const SparseSurface& surface, const SparseSurface& cover, const std::vector<bool>& in_triangle,
                 double margin_steps, ThreadPool& pool, std::vector<uint8_t>& removed);

}  // namespace meshwright
