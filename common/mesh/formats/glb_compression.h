// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <nlohmann/json.hpp>

#include "common/mesh/formats/glb_container.h"

namespace meshwright::glb {

// Positions as multiples of a step from an origin: whole numbers of 16 bits.
struct PositionLattice {
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();
  double step = 0;  // 0: positions stay floats
};

// The finest lattice over the bounds whose step is a power of two, which floats multiply by without loss. Floats where
// there are so many vertices (more than 2^24) that the step would be an eighth of what lies between them, or more.
PositionLattice LatticeFor(const Eigen::Vector3f& low, const Eigen::Vector3f& high, size_t vertices);

// What one primitive shows. Arrays are empty or have one entry for each vertex; without faces it is points.
struct PrimitiveArrays {
  std::vector<Eigen::Vector3f> positions;  // at least one
  std::vector<Eigen::Vector3f> normals;
  std::vector<std::array<uint8_t, 3>> colors;  // sRGB
  std::vector<Eigen::Vector2f> texture_coordinates;
  std::vector<std::array<uint32_t, 3>> faces;
};

// A primitive for EXT_meshopt_compression (Khronos, 2020): vertices in the order in which faces meet them, 16 bits a
// position and texture coordinate, 8 a normal (KHR_mesh_quantization), 16 a linear colour. Vertices that no face has
// are left out, when there are faces.
class CompressedPrimitive {
 public:
  CompressedPrimitive(PrimitiveArrays arrays, const PositionLattice& lattice);

  // Adds views and accessors for bytes(), which come next in the buffer. The primitive, without a material.
  nlohmann::json Describe(Description& description) const;
  const std::string& bytes() const { return bytes_; }

 private:
  struct View {
    std::string mode;  // of the extension
    size_t byte_length = 0;
    size_t stride = 0;
    size_t count = 0;
    std::string attribute;    // "": the corners of faces
    nlohmann::json accessor;  // componentType, type and what else it needs
  };
  void AddVertices(const char* attribute, const std::string& rows, nlohmann::json accessor);
  void AddFaces(const std::vector<std::array<uint32_t, 3>>& faces);
  void Add(View view, std::string compressed);

  size_t vertices_ = 0;
  std::vector<View> views_;
  std::string bytes_;
};

// The node of MeshNode for positions on a lattice.
nlohmann::json CompressedMeshNode(const Eigen::Vector3d& offset, const PositionLattice& lattice);

// Adds the file's buffer, the one that decoders make, and the extensions' names.
void DescribeCompressedBuffers(Description& description);

}  // namespace meshwright::glb
