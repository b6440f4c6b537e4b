// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>

#include <Eigen/Core>
#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "common/base/thread_pool.h"
#include "common/mesh/join_progress.h"
#include "common/mesh/load_surface.h"

namespace meshwright {

struct JoinOptions {
  // Pieces with fewer triangles, once everything is stitched, are left out. >= 0.
  int64_t min_component_faces = 100;
  // Holes up to this wide with a nearly flat rim are closed. Lattice steps, 0 .. 1000.
  double max_hole_steps = 30;
  // Gaps up to this large are closed where surface surrounds them and no camera looks through what closes them
  // (FindGapTriangles). Share of a photograph's longer side, 0 .. 1; 0: none are.
  double close_reach = 0.33;
  // How far from a seam the parts' colours run into each other. Lattice steps, 0 .. 1000.
  int blend_steps = 16;
  // Within each part triangles become fewer up to this error (SimplifyFaces). Pixel footprints g = z / f, the median of
  // the part's vertices, 0 .. 100; 0: none are left out.
  double simplify_footprints = 0;
  // Border vertices that are stitched at a time: what that takes of memory is some 100 bytes each. > 0.
  int64_t vertices_of_block = 250'000;

  absl::Status Validate() const;
};

struct JoinedMeshCounts {
  int64_t vertices = 0;
  int64_t faces = 0;
  int64_t patches_trimmed = 0;      // left out because an earlier surface shows them
  int64_t border_edges_before = 0;  // edges with one triangle, of the trimmed parts side by side
  int64_t border_edges_after = 0;   // the same in the mesh
  int64_t stitch_faces = 0;
  int64_t holes_filled = 0;
  int64_t hole_faces = 0;
  int64_t closing_faces = 0;  // that close gaps
  int64_t components_removed = 0;
  int64_t faces_simplified = 0;  // how many fewer there are because of simplify_footprints
  double area = 0;               // of all faces, scene units squared
};

// Joins the accepted surfaces 0 .. count - 1 (M_r of section 3.7, Jancosek et al. 2009, which leaves them side by side)
// into one mesh and writes it as PLY, with `offset` added (Scene::offset). Where surfaces overlap, the earlier one
// stays. Borders that come close are stitched, holes filled, gaps closed, small pieces left out, colours run into each
// other at the seams; positions stay. Parts are simplified one by one if wanted, all but their borders. Every edge has
// one or two triangles, and two run along it in opposite directions. The bytes depend on the surfaces, their order and
// the options alone, not on the threads.
//
// Loads each surface a few times, a few of them at a time. Borders of all of them are spooled in nameless files beside
// `path` (some 150 bytes for each of their vertices, and 1 byte for each patch) and worked on in blocks of neighbours,
// so that memory does not grow with them; where there is no room for such files they stay in memory. Errors: those of
// `load` or of PlyStreamWriter, InvalidArgument for options; then no file appears.
absl::StatusOr<JoinedMeshCounts> WriteJoinedMesh(
    int64_t count, const LoadSurface& load, const JoinOptions& options, const Eigen::Vector3d& offset,
    const std::string& path, ThreadPool& pool, const JoinListener& listener = [](double) {});

}  // namespace meshwright
