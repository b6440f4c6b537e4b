// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include <absl/status/status.h>

#include "common/mesh/formats/glb_compression.h"
#include "common/mesh/formats/mesh_rows.h"

namespace meshwright {

// Writes binary glTF 2.0 (Khronos, 2021) for viewers: positions, unit normals and COLOR_0 where the mesh has them;
// points when it has no faces. Colours go from sRGB to linear values of 16 bits, as glTF asks, and the material is
// unlit: photographs bring their light with them. Quality and camera stay behind: PLY is the format that keeps
// everything. Vertices keep the scene's coordinates, less
// its offset, which the node has; the node turns the scene, whose Y points down as that of its cameras does, to glTF's
// Y up. The file appears whole or not at all. OutOfRange when it would exceed the 4 GiB of the
// format.
absl::Status WriteGlb(const MeshRows& mesh, const std::string& path);
inline absl::Status WriteGlb(const TriangleMesh& mesh, const std::string& path) {
  return WriteGlb(MeshRows(mesh), path);
}

// The same by EXT_meshopt_compression, a third to a quarter of the size, for those who have its decoder (three.js,
// Cesium, Babylon.js): positions on a lattice (glb::LatticeFor), vertices in another order. The mesh is loaded.
absl::Status WriteCompressedGlb(const MeshRows& mesh, const std::string& path);

// One primitive, compressed, as a file of its own.
namespace glb {
absl::Status WriteCompressed(PrimitiveArrays arrays, const PositionLattice& lattice, const Eigen::Vector3d& offset,
                             const std::string& path);
}  // namespace glb

}  // namespace meshwright
