// SPDX-License-Identifier: Apache-2.0
#include "common/mesh/formats/mesh_rows.h"

#include <algorithm>
#include <fstream>
#include <utility>
#include <vector>

#include <absl/strings/str_cat.h>
#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include "common/base/status_macros.h"
#include "common/mesh/ply_header.h"

namespace meshwright {
namespace {

using ply::Element;
using ply::Header;
using ply::ScalarType;

constexpr size_t kLongestHeader = size_t{64} << 10;
constexpr size_t kFaceBytes = 1 + 3 * sizeof(uint32_t);

// The pages of a file, read when they are touched.
class MappedFile {
 public:
  // Null when it cannot be mapped.
  static std::shared_ptr<const MappedFile> Open(const std::string& path) {
    const int descriptor = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
    if (descriptor < 0) return nullptr;
    struct stat status = {};
    void* bytes = MAP_FAILED;
    if (::fstat(descriptor, &status) == 0 && S_ISREG(status.st_mode) && status.st_size > 0) {
      bytes = ::mmap(nullptr, static_cast<size_t>(status.st_size), PROT_READ, MAP_PRIVATE, descriptor, 0);
    }
    ::close(descriptor);
    if (bytes == MAP_FAILED) return nullptr;
    return std::shared_ptr<const MappedFile>(new MappedFile(bytes, static_cast<size_t>(status.st_size)));
  }
  ~MappedFile() { ::munmap(bytes_, size_); }
  MappedFile(const MappedFile&) = delete;
  MappedFile& operator=(const MappedFile&) = delete;

  const char* bytes() const { return static_cast<const char*>(bytes_); }
  size_t size() const { return size_; }

 private:
  MappedFile(void* bytes, size_t size) : bytes_(bytes), size_(size) {}
  void* bytes_;
  size_t size_;
};

// Whether the header is, to the byte, the one that we write for what it says.
bool IsOurs(const Header& header, const std::string& head, PlyAttributes* attributes) {
  const Element* vertex = header.Find("vertex");
  const Element* face = header.Find("face");
  if (header.encoding != ply::Encoding::kBinaryLittleEndian || vertex == nullptr || face == nullptr) return false;
  *attributes = {.normals = vertex->Find("nx") >= 0,
                 .colors = vertex->Find("red") >= 0,
                 .quality = vertex->Find("quality") >= 0,
                 .cameras = vertex->Find("camera_index") >= 0,
                 .offset = header.world_offset.value_or(Eigen::Vector3d::Zero())};
  const std::string ours =
      ply::FormatHeader(*attributes, static_cast<int64_t>(vertex->count), static_cast<int64_t>(face->count));
  return head.compare(0, header.body_offset, ours) == 0;
}

}  // namespace

MeshRows::MeshRows(const TriangleMesh& mesh) {
  const auto column = [](const auto& values) {
    return Column{reinterpret_cast<const char*>(values.data()), sizeof(values[0]), values.size()};
  };
  positions_ = column(mesh.positions);
  normals_ = column(mesh.normals);
  colors_ = column(mesh.colors);
  quality_ = column(mesh.quality);
  cameras_ = column(mesh.cameras);
  faces_ = column(mesh.faces);
  offset_ = mesh.offset;
}

absl::StatusOr<MeshRows> MeshRows::OpenPly(const std::string& path) {
  std::string head(kLongestHeader, '\0');
  std::ifstream file(path, std::ios::binary);
  file.read(head.data(), static_cast<std::streamsize>(head.size()));
  head.resize(static_cast<size_t>(file.gcount()));
  const absl::StatusOr<Header> header = ply::ParseHeader(head, path);
  PlyAttributes attributes;
  if (header.ok() && IsOurs(*header, head, &attributes)) {
    const size_t vertices = header->Find("vertex")->count;
    const size_t faces = header->Find("face")->count;
    const size_t position_bytes = 3 * (attributes.has_offset() ? sizeof(double) : sizeof(float));
    const size_t vertex_bytes = position_bytes + (attributes.normals ? 3 * sizeof(float) : 0) +
                                (attributes.colors ? 3 : 0) + (attributes.quality ? sizeof(float) : 0) +
                                (attributes.cameras ? sizeof(CameraIndex) : 0);
    const auto mapped = MappedFile::Open(path);
    const bool fits = mapped != nullptr && vertices <= mapped->size() / vertex_bytes &&
                      faces <= mapped->size() / kFaceBytes &&
                      header->body_offset + vertices * vertex_bytes + faces * kFaceBytes <= mapped->size();
    if (fits) {
      MeshRows rows;
      const char* next = mapped->bytes() + header->body_offset;
      const auto take = [&](bool there, size_t bytes) {
        const Column column = {next, vertex_bytes, there ? vertices : 0};
        if (there) next += bytes;
        return column;
      };
      rows.offset_ = attributes.offset;
      rows.has_doubles_ = attributes.has_offset();
      rows.positions_ = take(true, position_bytes);
      rows.normals_ = take(attributes.normals, 3 * sizeof(float));
      rows.colors_ = take(attributes.colors, 3);
      rows.quality_ = take(attributes.quality, sizeof(float));
      rows.cameras_ = take(attributes.cameras, sizeof(CameraIndex));
      rows.faces_ = {mapped->bytes() + header->body_offset + vertices * vertex_bytes + 1, kFaceBytes, faces};
      rows.storage_ = mapped;
      MW_RETURN_IF_ERROR(rows.CheckRows(path));
      return rows;
    }
  }
  MW_ASSIGN_OR_RETURN(TriangleMesh mesh, ReadPly(path));
  const auto owned = std::make_shared<const TriangleMesh>(std::move(mesh));
  MeshRows rows(*owned);
  rows.storage_ = owned;
  return rows;
}

absl::Status MeshRows::CheckRows(const std::string& path) const {
  for (size_t v = 0; v < vertices(); ++v) {
    if (!Position(v).allFinite()) {
      return absl::InvalidArgumentError(absl::StrCat(path, ": vertex ", v, ": x, y and z expected to be finite"));
    }
  }
  for (size_t f = 0; f < faces(); ++f) {
    const char* const corners = faces_.begin + f * kFaceBytes - 1;
    const std::array<uint32_t, 3> face = Face(f);
    const uint32_t largest = *std::max_element(face.begin(), face.end());
    if (*corners != 3 || largest >= vertices()) {
      return absl::InvalidArgumentError(absl::StrCat(path, ": face ", f, ": ", static_cast<int>(*corners),
                                                     " corners with indices up to ", largest,
                                                     ", expected 3 below the number of vertices, ", vertices()));
    }
  }
  return absl::OkStatus();
}

PlyAttributes MeshRows::attributes() const {
  return {.normals = has_normals(),
          .colors = has_colors(),
          .quality = quality_.count > 0,
          .cameras = cameras_.count > 0,
          .offset = offset_};
}

MeshRows::Bounds MeshRows::FindBounds() const {
  Bounds bounds = {Position(0), Position(0)};
  for (size_t v = 1; v < vertices(); ++v) {
    const Eigen::Vector3f x = Position(v);
    bounds.low = bounds.low.cwiseMin(x);
    bounds.high = bounds.high.cwiseMax(x);
  }
  return bounds;
}

}  // namespace meshwright
