// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include <absl/strings/str_cat.h>
#include <zlib.h>

#include "common/base/check.h"
#include "common/base/files.h"
#include "common/base/little_endian.h"
#include "common/base/temporary_folder_testing.h"
#include "common/mesh/ply.h"
#include "common/surface/codec.h"
#include "common/surface/random_surface_testing.h"
#include "common/surface/triangulation.h"
#include "tests/fuzz/target.h"

namespace meshwright::fuzz {
namespace {

// A dense copy takes memory by the lattice, which bytes may call as large as they like.
constexpr int64_t kMaxDenseNodes = 1 << 20;

void ReadSurface(const std::string& bytes) {
  // As it is, and with the length and the checksum that belong to it: whoever means harm has them right.
  std::string fitting = bytes;
  if (fitting.size() >= 20) {
    StoreLittleEndian(static_cast<uint64_t>(fitting.size()), &fitting[8]);
    const size_t covered = fitting.size() - 4;
    const uLong crc = ::crc32(0, reinterpret_cast<const Bytef*>(fitting.data()), static_cast<uInt>(covered));
    StoreLittleEndian(static_cast<uint32_t>(crc), &fitting[covered]);
  }
  for (const std::string& text : {bytes, fitting}) {
    const absl::StatusOr<SparseSurface> surface = DecodeSparseSurface(text);
    if (!surface.ok()) continue;
    const std::string encoded = EncodeSurface(*surface);
    const absl::StatusOr<SparseSurface> again = DecodeSparseSurface(encoded);
    MW_CHECK(again.ok() && EncodeSurface(*again) == encoded);
    for (const auto& triangle : Triangulate(*surface)) {
      for (const int32_t corner : triangle) {
        MW_CHECK(corner >= 0 && static_cast<size_t>(corner) < surface->node.size());
      }
    }
    if (surface->lattice.nodes() > kMaxDenseNodes) continue;
    const absl::StatusOr<PatchLattice> dense = DecodeSurface(encoded);
    MW_CHECK(dense.ok() && EncodeSurface(*dense) == encoded);
  }
}

void ReadMesh(const std::string& bytes) {
  const absl::StatusOr<TriangleMesh> mesh = ParsePly(bytes, "mesh");
  if (!mesh.ok()) return;
  for (const Eigen::Vector3f& x : mesh->positions) MW_CHECK(x.allFinite());
  for (const auto& face : mesh->faces) {
    for (const uint32_t corner : face) MW_CHECK(corner < mesh->positions.size());
  }
  for (const size_t count : {mesh->normals.size(), mesh->colors.size(), mesh->quality.size()}) {
    MW_CHECK(count == 0 || count == mesh->positions.size());
  }
}

std::string SmallPly() {
  TriangleMesh mesh;
  for (int i = 0; i < 4; ++i) {
    mesh.positions.emplace_back(static_cast<float>(i % 2), static_cast<float>(i / 2), 0.5F);
    mesh.normals.emplace_back(0, 0, 1);
    mesh.colors.push_back({1, 2, 3});
    mesh.quality.push_back(0.5F);
  }
  mesh.faces = {{0, 1, 2}, {1, 3, 2}};
  const TemporaryFolder folder;
  MW_CHECK(WritePly(mesh, folder / "mesh.ply").ok());
  return ReadFile(folder / "mesh.ply").value();
}

std::string AsciiPly() {
  return "ply\nformat ascii 1.0\ncomment made by hand\nelement vertex 4\nproperty double x\nproperty float y\n"
         "property float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\nelement face 2\n"
         "property list uchar int vertex_indices\nend_header\n0 0 0 1 2 3\n1 0 0 1 2 3\n0 1 0 1 2 3\n1 1 0 1 2 3\n"
         "3 0 1 2\n4 0 1 3 2\n";
}

}  // namespace

std::vector<Target> GeometryTargets() {
  std::string big_endian = AsciiPly();
  big_endian.replace(big_endian.find("ascii"), 5, "binary_big_endian");
  return {
      {"surface",
       ReadSurface,
       {EncodeSurface(RandomSurface(1, SmallCamera(12, 9), 1, 0.7, 0.7)),
        EncodeSurface(RandomSurface(2, SmallCamera(40, 30), 4, 1, 1)),
        EncodeSurface(PatchLattice::Empty(0, SmallCamera(8, 8), 2))},
       {"MWSF"}},
      {"ply",
       ReadMesh,
       {SmallPly(), AsciiPly(), big_endian},
       {"ply\n", "format ascii 1.0\n", "format binary_little_endian 1.0\n", "element vertex ", "element face ",
        "property list uchar int vertex_indices\n", "property double x\n", "end_header\n",
        "property list int float q\n", "4294967295", "nan"}},
  };
}

}  // namespace meshwright::fuzz
