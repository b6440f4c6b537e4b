// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <absl/strings/str_cat.h>
#include <absl/types/span.h>
#include <unistd.h>

#include "common/base/check.h"
#include "common/base/files.h"
#include "common/base/little_endian.h"
#include "common/base/nameless_file.h"
#include "common/base/status_macros.h"
#include "common/mesh/ply.h"
#include "common/mesh/ply_header.h"

namespace meshwright {
namespace {

constexpr size_t kRowsAtOnce = 1 << 14;
constexpr size_t kFaceBytes = 1 + 3 * sizeof(uint32_t);
constexpr size_t kCopyBytes = size_t{1} << 20;

size_t VertexBytes(const PlyAttributes& attributes) {
  return 3 * (attributes.has_offset() ? sizeof(double) : sizeof(float)) + (attributes.normals ? 3 * sizeof(float) : 0) +
         (attributes.colors ? 3 : 0) + (attributes.quality ? sizeof(float) : 0) +
         (attributes.cameras ? sizeof(int32_t) : 0);
}

char* StoreVector(const Eigen::Vector3f& vector, char* out) {
  for (int k = 0; k < 3; ++k) out = StoreLittleEndian(vector[k], out);
  return out;
}

char* StoreVertex(const TriangleMesh& mesh, const PlyAttributes& attributes, size_t i, char* out) {
  if (attributes.has_offset()) {
    for (int k = 0; k < 3; ++k) {
      out = StoreLittleEndian(static_cast<double>(mesh.positions[i][k]) + attributes.offset[k], out);
    }
  } else {
    out = StoreVector(mesh.positions[i], out);
  }
  if (attributes.normals) out = StoreVector(mesh.normals[i], out);
  if (attributes.colors) {
    for (const uint8_t channel : mesh.colors[i]) out = StoreLittleEndian(channel, out);
  }
  if (attributes.quality) out = StoreLittleEndian(mesh.quality[i], out);
  if (attributes.cameras) out = StoreLittleEndian(mesh.cameras[i], out);
  return out;
}

char* StoreFace(const std::array<uint32_t, 3>& face, uint32_t first_vertex, char* out) {
  out = StoreLittleEndian(uint8_t{3}, out);
  for (const uint32_t corner : face) out = StoreLittleEndian(corner + first_vertex, out);
  return out;
}

// Calls store(i, out) for rows 0..count and hands the bytes to write(span) in large pieces.
template <typename Store, typename Write>
absl::Status WriteRows(size_t count, size_t row_bytes, const Store& store, const Write& write) {
  std::vector<char> buffer(std::min(count, kRowsAtOnce) * row_bytes);
  for (size_t begin = 0; begin < count; begin += kRowsAtOnce) {
    const size_t end = std::min(count, begin + kRowsAtOnce);
    char* out = buffer.data();
    for (size_t i = begin; i < end; ++i) out = store(i, out);
    MW_RETURN_IF_ERROR(
        write(absl::MakeConstSpan(reinterpret_cast<const uint8_t*>(buffer.data()), (end - begin) * row_bytes)));
  }
  return absl::OkStatus();
}

absl::Status WriteVertices(const TriangleMesh& mesh, const PlyAttributes& attributes, AtomicFile& file) {
  const size_t vertices = mesh.positions.size();
  MW_CHECK(!attributes.normals || mesh.normals.size() == vertices);
  MW_CHECK(!attributes.colors || mesh.colors.size() == vertices);
  MW_CHECK(!attributes.quality || mesh.quality.size() == vertices);
  MW_CHECK(!attributes.cameras || mesh.cameras.size() == vertices);
  return WriteRows(
      vertices, VertexBytes(attributes), [&](size_t i, char* out) { return StoreVertex(mesh, attributes, i, out); },
      [&](absl::Span<const uint8_t> bytes) { return file.Append(bytes); });
}

template <typename Write>
absl::Status WriteFaces(absl::Span<const std::array<uint32_t, 3>> faces, uint32_t first_vertex, const Write& write) {
  return WriteRows(
      faces.size(), kFaceBytes, [&](size_t i, char* out) { return StoreFace(faces[i], first_vertex, out); }, write);
}

absl::Status CheckVertexCount(uint64_t vertices, const std::string& path) {
  constexpr uint64_t kMost = std::numeric_limits<uint32_t>::max();
  if (vertices <= kMost) return absl::OkStatus();
  return absl::OutOfRangeError(
      absl::StrCat(path, ": ", vertices, " vertices, expected at most ", kMost, ", which PLY indices can tell apart"));
}

absl::Status WriteToTemporary(int descriptor, absl::Span<const uint8_t> bytes, const std::string& path) {
  while (!bytes.empty()) {
    const ssize_t written = ::write(descriptor, bytes.data(), bytes.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) return NamelessFileError("write", path, errno);
    bytes.remove_prefix(static_cast<size_t>(written));
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status WritePly(const TriangleMesh& mesh, const std::string& path) {
  MW_RETURN_IF_ERROR(CheckVertexCount(mesh.positions.size(), path));
  const PlyAttributes attributes{.normals = !mesh.normals.empty(),
                                 .colors = !mesh.colors.empty(),
                                 .quality = !mesh.quality.empty(),
                                 .cameras = !mesh.cameras.empty(),
                                 .offset = mesh.offset};
  MW_ASSIGN_OR_RETURN(AtomicFile file, AtomicFile::Create(path));
  MW_RETURN_IF_ERROR(file.Append(ply::FormatHeader(attributes, static_cast<int64_t>(mesh.positions.size()),
                                                   static_cast<int64_t>(mesh.faces.size()))));
  MW_RETURN_IF_ERROR(WriteVertices(mesh, attributes, file));
  MW_RETURN_IF_ERROR(WriteFaces(mesh.faces, 0, [&](absl::Span<const uint8_t> bytes) { return file.Append(bytes); }));
  return file.Commit();
}

PlyStreamWriter::PlyStreamWriter(std::string path, const PlyAttributes& attributes, AtomicFile file,
                                 int faces_descriptor)
    : path_(std::move(path)), attributes_(attributes), file_(std::move(file)), faces_descriptor_(faces_descriptor) {}

PlyStreamWriter::PlyStreamWriter(PlyStreamWriter&& other) noexcept
    : path_(std::move(other.path_)),
      attributes_(other.attributes_),
      file_(std::move(other.file_)),
      faces_descriptor_(std::exchange(other.faces_descriptor_, -1)),
      vertices_(other.vertices_),
      faces_(other.faces_) {}

PlyStreamWriter::~PlyStreamWriter() {
  if (faces_descriptor_ >= 0) ::close(faces_descriptor_);
}

absl::StatusOr<PlyStreamWriter> PlyStreamWriter::Create(const std::string& path, const PlyAttributes& attributes) {
  MW_ASSIGN_OR_RETURN(AtomicFile file, AtomicFile::Create(path));
  MW_ASSIGN_OR_RETURN(const int descriptor, CreateNamelessFile(path));
  PlyStreamWriter writer(path, attributes, std::move(file), descriptor);
  MW_RETURN_IF_ERROR(writer.file_.Append(ply::FormatHeader(attributes, 0, 0)));
  return writer;
}

absl::Status PlyStreamWriter::Append(const TriangleMesh& part) {
  MW_RETURN_IF_ERROR(CheckVertexCount(static_cast<uint64_t>(vertices_) + part.positions.size(), path_));
  MW_RETURN_IF_ERROR(WriteVertices(part, attributes_, file_));
  MW_RETURN_IF_ERROR(WriteFaces(part.faces, static_cast<uint32_t>(vertices_), [&](absl::Span<const uint8_t> bytes) {
    return WriteToTemporary(faces_descriptor_, bytes, path_);
  }));
  vertices_ += static_cast<int64_t>(part.positions.size());
  faces_ += static_cast<int64_t>(part.faces.size());
  return absl::OkStatus();
}

absl::Status PlyStreamWriter::AppendFaces(absl::Span<const std::array<uint32_t, 3>> faces) {
  for (const auto& face : faces) {
    for (const uint32_t corner : face) MW_CHECK(static_cast<int64_t>(corner) < vertices_);
  }
  MW_RETURN_IF_ERROR(WriteFaces(
      faces, 0, [&](absl::Span<const uint8_t> bytes) { return WriteToTemporary(faces_descriptor_, bytes, path_); }));
  faces_ += static_cast<int64_t>(faces.size());
  return absl::OkStatus();
}

absl::Status PlyStreamWriter::Commit() {
  if (::lseek(faces_descriptor_, 0, SEEK_SET) < 0) return NamelessFileError("read", path_, errno);
  std::vector<uint8_t> buffer(kCopyBytes);
  int64_t copied = 0;
  while (true) {
    const ssize_t count = ::read(faces_descriptor_, buffer.data(), buffer.size());
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) return NamelessFileError("read", path_, errno);
    if (count == 0) break;
    MW_RETURN_IF_ERROR(file_.Append(absl::MakeConstSpan(buffer.data(), static_cast<size_t>(count))));
    copied += count;
  }
  if (copied != faces_ * static_cast<int64_t>(kFaceBytes)) {
    return absl::DataLossError(absl::StrCat(path_, ": the temporary file of its faces has ", copied,
                                            " bytes, expected ", faces_ * static_cast<int64_t>(kFaceBytes)));
  }
  MW_RETURN_IF_ERROR(file_.WriteAt(0, ply::FormatHeader(attributes_, vertices_, faces_)));
  return file_.Commit();
}

}  // namespace meshwright
