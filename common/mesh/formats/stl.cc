// SPDX-License-Identifier: Apache-2.0
#include "common/mesh/formats/stl.h"

#include <limits>

#include <Eigen/Geometry>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include "common/mesh/formats/row_writer.h"

namespace meshwright {
namespace {

constexpr size_t kHeaderBytes = 80;

void AppendTriangle(const MeshRows& mesh, size_t face, std::string& bytes) {
  const std::array<uint32_t, 3> corners = mesh.Face(face);
  const Eigen::Vector3f a = mesh.Position(corners[0]);
  const Eigen::Vector3f b = mesh.Position(corners[1]);
  const Eigen::Vector3f c = mesh.Position(corners[2]);
  const Eigen::Vector3f normal = (b - a).cross(c - a);
  const float length = normal.norm();
  AppendVector(length > 0 ? Eigen::Vector3f(normal / length) : Eigen::Vector3f::Zero(), bytes);
  for (const Eigen::Vector3f& x : {a, b, c}) AppendVector(x, bytes);
  AppendLittleEndian(uint16_t{0}, bytes);
}

}  // namespace

absl::Status WriteStl(const MeshRows& mesh, const std::string& path) {
  if (mesh.faces() == 0) {
    return absl::InvalidArgumentError(absl::StrCat(path, ": the mesh has 0 faces, STL expects at least 1"));
  }
  constexpr size_t kMost = std::numeric_limits<uint32_t>::max();
  if (mesh.faces() > kMost) {
    return absl::OutOfRangeError(
        absl::StrCat(path, ": the mesh has ", mesh.faces(), " faces, expected at most ", kMost, " in STL"));
  }
  std::string head = "Meshwright";
  if (mesh.has_offset()) {
    const Eigen::Vector3d& offset = mesh.offset();
    absl::StrAppend(&head, absl::StrFormat(" offset %.10g %.10g %.10g", offset.x(), offset.y(), offset.z()));
  }
  head.resize(kHeaderBytes, ' ');
  AppendLittleEndian(static_cast<uint32_t>(mesh.faces()), head);
  MW_ASSIGN_OR_RETURN(AtomicFile file, AtomicFile::Create(path));
  MW_RETURN_IF_ERROR(file.Append(head));
  MW_RETURN_IF_ERROR(AppendRows(
      mesh.faces(), [&](size_t face, std::string& bytes) { AppendTriangle(mesh, face, bytes); }, file));
  return file.Commit();
}

}  // namespace meshwright
