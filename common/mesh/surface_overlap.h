#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "common/base/thread_pool.h"
#include "common/surface/patch_lattice.h"

namespace meshwright {

// Where an accepted surface lies, in tiles of its lattice: little enough to keep for all surfaces at once.
class SurfaceOutline {
 public:
  explicit SurfaceOutline(const PatchLattice& surface);

  // False only if no patch of this surface lies within `margin_steps` lattice steps of `other` on other's rays.
  bool MayOverlap(const SurfaceOutline& other, double margin_steps) const;

 private:
  struct Ball {  // around the patches of one tile
    Eigen::Vector3f center_in_world;
    float radius;
  };
  bool MayContain(const Ball& ball, double margin_steps) const;

  Camera camera_;
  Lattice lattice_;
  int tile_columns_ = 0;
  int tile_rows_ = 0;
  std::vector<float> nearest_;   // depth, per tile; 0: no patch in it
  std::vector<float> farthest_;  // depth, per tile
  std::vector<Ball> balls_;
};

// An accepted surface that others may have to give way to.
struct CoveringSurface {
  explicit CoveringSurface(PatchLattice surface);

  PatchLattice surface;
  std::vector<uint8_t> in_triangle;  // per node: it is the corner of a triangle
};

// Marks in `removed` (one entry per node of `surface`) each patch that `cover` shows too: the node of `cover` nearest
// to its projection is the corner of a triangle, its plane passes within `margin_steps` d of the patch (d of section
// 3.3, Jancosek et al. 2009, the coarser one), and the normals differ by less than 60 degrees. Both sides of a thin
// wall stay.
void MarkCovered(const PatchLattice& surface, const CoveringSurface& cover, double margin_steps, ThreadPool& pool,
                 std::vector<uint8_t>& removed);

}  // namespace meshwright
