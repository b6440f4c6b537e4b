// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "common/geometry/camera.h"
#include "common/image/color_image.h"
#include "common/mesh/formats/mesh_rows.h"

namespace meshwright {

// A mesh as a camera sees it, in the colours of its vertices, on `background` grey. Rows are read where they lie, so
// that memory follows the picture alone. `mesh` has colours and is less the camera's world by `mesh.offset()`, as
// meshes of a scene are.
ColorImage DrawMesh(const MeshRows& mesh, const Camera& camera, uint8_t background);

// Points of a mesh that stand for all of it: positions and normals of every so many vertices.
struct MeshSample {
  std::vector<Eigen::Vector3f> positions;
  std::vector<Eigen::Vector3f> normals;
};
MeshSample SampleMesh(const MeshRows& mesh, size_t most);

// Which cells of a coarse grid over the camera's image show a side of the mesh that faces the camera; what stands
// before it is not asked. Cells are as few as the sample allows.
struct SeenCells {
  int columns = 0;
  int rows = 0;
  std::vector<bool> seen;  // rows from the top
  double share() const;
};
SeenCells FindSeenCells(const MeshSample& sample, const Camera& camera);

// The photograph in grey where the mesh is not seen.
void FadeUnseen(const SeenCells& cells, ColorImage& photograph);

}  // namespace meshwright
