// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <memory>
#include <string>

#include <Eigen/Core>
#include <absl/status/statusor.h>

#include "common/mesh/ply.h"
#include "common/mesh/triangle_mesh.h"

namespace meshwright {

// A mesh read row by row, wherever it lies: in memory, or in a PLY file, which is mapped and not loaded, so that a mesh
// larger than the memory can be converted. What writers of formats read from.
class MeshRows {
 public:
  // `mesh` outlives the rows.
  explicit MeshRows(const TriangleMesh& mesh);
  // Files in the layout that WritePly gives are mapped, all others are read by ReadPly. Errors are ReadPly's.
  static absl::StatusOr<MeshRows> OpenPly(const std::string& path);

  // What is left is a point cloud.
  void DropFaces() { faces_ = {}; }

  size_t vertices() const { return positions_.count; }
  size_t faces() const { return faces_.count; }
  bool has_normals() const { return normals_.count > 0; }
  bool has_colors() const { return colors_.count > 0; }
  // The four optional attributes that there are, and the offset.
  PlyAttributes attributes() const;

  // Less offset(); scene units.
  Eigen::Vector3f Position(size_t vertex) const {
    if (!has_doubles_) return positions_.Load<Eigen::Vector3f>(vertex);
    return (positions_.Load<Eigen::Vector3d>(vertex) - offset_).cast<float>();
  }
  // As it is in the world, with all digits that there are.
  Eigen::Vector3d WorldPosition(size_t vertex) const {
    if (has_doubles_) return positions_.Load<Eigen::Vector3d>(vertex);
    return positions_.Load<Eigen::Vector3f>(vertex).cast<double>() + offset_;
  }
  const Eigen::Vector3d& offset() const { return offset_; }
  bool has_offset() const { return !offset_.isZero(0); }
  Eigen::Vector3f Normal(size_t vertex) const { return normals_.Load<Eigen::Vector3f>(vertex); }
  std::array<uint8_t, 3> Color(size_t vertex) const { return colors_.Load<std::array<uint8_t, 3>>(vertex); }
  float Quality(size_t vertex) const { return quality_.Load<float>(vertex); }
  CameraIndex Camera(size_t vertex) const { return cameras_.Load<CameraIndex>(vertex); }
  std::array<uint32_t, 3> Face(size_t face) const { return faces_.Load<std::array<uint32_t, 3>>(face); }

  // Bounds of the positions less the offset; there must be one.
  struct Bounds {
    Eigen::Vector3f low;
    Eigen::Vector3f high;
  };
  Bounds FindBounds() const;

 private:
  // Values of one kind, `stride` bytes from each other; they need not be aligned.
  struct Column {
    const char* begin = nullptr;
    size_t stride = 0;
    size_t count = 0;

    template <typename T>
    T Load(size_t row) const {
      T value;
      std::memcpy(static_cast<void*>(&value), begin + row * stride, sizeof(T));
      return value;
    }
  };

  MeshRows() = default;
  absl::Status CheckRows(const std::string& path) const;

  Eigen::Vector3d offset_ = Eigen::Vector3d::Zero();
  bool has_doubles_ = false;  // positions_ are doubles with the offset added, as our PLY files have them
  Column positions_;
  Column normals_;
  Column colors_;
  Column quality_;
  Column cameras_;
  Column faces_;
  std::shared_ptr<const void> storage_;  // what the columns point into, when it is ours
};

}  // namespace meshwright
