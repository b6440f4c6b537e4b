// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <string>

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <absl/types/span.h>

#include "common/base/files.h"
#include "common/mesh/triangle_mesh.h"

namespace meshwright {

// PLY 1.0 (Turk, 1994). Reads ascii and binary files of either byte order, with any scalar types and any order of
// properties. Element vertex: x y z are required; nx ny nz, red green blue (integers 0..255, or floats 0..1), quality
// (or confidence) and camera_index are taken when there. Element face: vertex_indices (or vertex_index); polygons
// become fans, fewer than three corners are left out; without faces the file is a point cloud. Everything else is
// skipped. Double x y z far from zero are read less an offset (TriangleMesh): that of the comment that our files have,
// or the first vertex, rounded to 100. Normals and qualities that are not finite become 0. Errors: what ReadFile says;
// InvalidArgument names file, field, value and what was expected.
absl::StatusOr<TriangleMesh> ReadPly(const std::string& path);
// The same from memory. `name` stands for the file in messages.
absl::StatusOr<TriangleMesh> ParsePly(const std::string& bytes, const std::string& name);

// Which optional attributes the vertices of a written file have.
struct PlyAttributes {
  bool normals = false;  // float nx ny nz
  bool colors = false;   // uchar red green blue
  bool quality = false;  // float quality
  bool cameras = false;  // int camera_index
  // Where it is not 0 positions are written as double x y z with it added, and "comment offset X Y Z" tells it.
  Eigen::Vector3d offset = Eigen::Vector3d::Zero();

  bool has_offset() const { return !offset.isZero(0); }
};

// Writes binary little-endian PLY with the attributes and the offset that the mesh has. The file appears whole or not
// at all.
absl::Status WritePly(const TriangleMesh& mesh, const std::string& path);

// Writes a mesh that comes in parts, in memory that depends on the largest part only: vertices go to the output, faces
// to a nameless temporary beside it until Commit(). The bytes are those that WritePly gives for all parts in one mesh.
// Destroying it without Commit() leaves nothing behind.
class PlyStreamWriter {
 public:
  static absl::StatusOr<PlyStreamWriter> Create(const std::string& path, const PlyAttributes& attributes);
  PlyStreamWriter(PlyStreamWriter&& other) noexcept;
  PlyStreamWriter& operator=(PlyStreamWriter&& other) = delete;
  PlyStreamWriter(const PlyStreamWriter&) = delete;
  ~PlyStreamWriter();

  // Faces of `part` index the part's own vertices. The part must have every attribute named at Create; others are
  // ignored, the offset too: all parts have that of Create. OutOfRange when the file would have more vertices than an
  // index of 32 bits can tell apart.
  absl::Status Append(const TriangleMesh& part);
  // Faces between vertices that were appended in any part before. Corners count from the first vertex of the file.
  absl::Status AppendFaces(absl::Span<const std::array<uint32_t, 3>> faces);
  absl::Status Commit();

  int64_t vertices() const { return vertices_; }
  int64_t faces() const { return faces_; }

 private:
  PlyStreamWriter(std::string path, const PlyAttributes& attributes, AtomicFile file, int faces_descriptor);

  std::string path_;
  PlyAttributes attributes_;
  AtomicFile file_;
  int faces_descriptor_ = -1;
  int64_t vertices_ = 0;
  int64_t faces_ = 0;
};

}  // namespace meshwright
