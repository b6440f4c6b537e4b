#pragma once

#include <string>

#include <absl/status/status.h>

#include "common/mesh/formats/mesh_rows.h"

namespace meshwright {

// Writes binary glTF 2.0 (Khronos, 2021) for viewers: positions, unit normals and COLOR_0 where the mesh has them;
// points when it has no faces. Colours go from sRGB to linear values of 16 bits, as glTF asks, and the material is
// unlit: photographs bring their light with them. Quality and camera stay behind: PLY is the format that keeps
// everything. Vertices keep the scene's coordinates, less
// its offset, which the node has; the node turns the scene, whose Y points down as that of its
// cameras does, to glTF's Y up. The file appears whole or not at all. OutOfRange when it would exceed the 4 GiB of the
// format.
absl::Status WriteGlb(const MeshRows& mesh, const std::string& path);
inline absl::Status WriteGlb(const TriangleMesh& mesh, const std::string& path) {
  return WriteGlb(MeshRows(mesh), path);
}

}  // namespace meshwright
// SPDX-License-Identifier: Apache-2.0
