// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <string>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "common/base/thread_pool.h"
#include "common/mesh/triangle_mesh.h"
#include "common/scene/scene.h"

// What other programs go on from: a scene with its photographs undistorted, and a mesh of it.
namespace meshwright {

struct WorkspaceSettings {
  std::string folder;      // made when it is not there
  int max_image_size = 0;  // px, of the undistorted photographs; 0: as they are
};

// Photographs written so far, of all.
using WorkspaceProgress = std::function<void(int done, int total)>;

// COLMAP's dense workspace: images/, sparse/ (text, PINHOLE), stereo/ with the mesh's depth and normals as each camera
// sees it in depth_maps/NAME.geometric.bin and normal_maps/, patch-match.cfg and fusion.cfg. Depths are z, 0 where
// there is no surface or a mask; normals are in the camera's frame, towards it. `colmap stereo_fusion --input_type
// geometric`, `poisson_mesher` and `delaunay_mesher` take it. One photograph in memory at a time, beside the mesh.
absl::Status WriteColmapWorkspace(const Scene& scene, TriangleMesh mesh, const WorkspaceSettings& settings,
                                  ThreadPool& pool, const WorkspaceProgress& progress);

// scene.mvs (interface version 2, which every OpenMVS reads), undistorted photographs in images/, and mesh.ply. The
// scene's offset is the file's transform; mesh and points are less it. `TextureMesh scene.mvs -m mesh.ply` takes them.
absl::Status WriteOpenMvsWorkspace(const Scene& scene, TriangleMesh mesh, const WorkspaceSettings& settings,
                                   ThreadPool& pool, const WorkspaceProgress& progress);

}  // namespace meshwright
