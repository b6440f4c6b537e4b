// SPDX-License-Identifier: Apache-2.0
#include "coordinator/rest/part_preview.h"

#include <cmath>
#include <set>

#include <gtest/gtest.h>

#include "common/base/little_endian.h"
#include "common/surface/random_surface_testing.h"
#include "common/surface/triangulation.h"

namespace meshwright {
namespace {

constexpr size_t kHeaderBytes = 56;

// The layout as a browser reads it.
struct Read {
  uint32_t sequence = 0, camera = 0, stride = 0, faces_of_surface = 0;
  Eigen::Vector3f smallest, largest;
  std::vector<Eigen::Vector3f> positions;
  std::vector<std::array<uint8_t, 3>> colors;
  std::vector<std::array<uint32_t, 3>> faces;
};

Read Parse(const std::string& bytes) {
  const auto number = [&](size_t at) { return LoadLittleEndian<uint32_t>(bytes.data() + at); };
  const auto vector = [&](size_t at) {
    Eigen::Vector3f v;
    for (size_t k = 0; k < 3; ++k) v[static_cast<int>(k)] = LoadLittleEndian<float>(bytes.data() + at + 4 * k);
    return v;
  };
  EXPECT_EQ(bytes.substr(0, 4), "MWPV");
  EXPECT_EQ(number(4), 1U);
  const size_t vertices = number(16);
  const size_t faces = number(20);
  const size_t colors_at = kHeaderBytes + 12 * vertices;
  const size_t faces_at = colors_at + 4 * ((3 * vertices + 3) / 4);
  EXPECT_EQ(bytes.size(), faces_at + 12 * faces);
  Read read = {.sequence = number(8), .camera = number(12), .stride = number(24), .faces_of_surface = number(28)};
  read.smallest = vector(32);
  read.largest = vector(44);
  for (size_t i = 0; i < vertices; ++i) {
    read.positions.push_back(vector(kHeaderBytes + 12 * i));
    const auto* rgb = reinterpret_cast<const uint8_t*>(bytes.data() + colors_at + 3 * i);
    read.colors.push_back({rgb[0], rgb[1], rgb[2]});
  }
  for (size_t i = 0; i < faces; ++i) {
    read.faces.push_back({number(faces_at + 12 * i), number(faces_at + 12 * i + 4), number(faces_at + 12 * i + 8)});
  }
  return read;
}

// A wall across the photograph, and on its right third another one, much nearer.
SparseSurface Walls(int width, int height) {
  const Camera camera = {.width = width, .height = height, .fx = 100, .fy = 100, .cx = 50, .cy = 40};
  PatchLattice surface = PatchLattice::Empty(7, camera, 1);
  for (int row = 0; row < surface.lattice.rows; ++row) {
    for (int column = 0; column < surface.lattice.columns; ++column) {
      const auto i = static_cast<size_t>(surface.lattice.Index(column, row));
      const bool near = 3 * column >= 2 * surface.lattice.columns;
      surface.depth[i] = near ? 4 : 10;
      surface.rgb[i] = {static_cast<uint8_t>(near), static_cast<uint8_t>(column), static_cast<uint8_t>(row)};
      const bool last_of_wall =
          column + 1 == surface.lattice.columns || (!near && 3 * (column + 1) >= 2 * surface.lattice.columns);
      if (!last_of_wall) surface.links[i] |= PatchLattice::kLinkRight;
      if (row + 1 < surface.lattice.rows) surface.links[i] |= PatchLattice::kLinkDown;
    }
  }
  return SparseSurface::From(surface);
}

TEST(PartPreviewTest, IsTheSurfaceItselfWhenItsTrianglesMayBe) {
  const SparseSurface surface = SparseSurface::From(RandomSurface(5, SmallCamera(41, 33), 1, 0.9, 0.8));
  const auto triangles = Triangulate(surface);
  const Read read = Parse(MakePartPreview(surface, 3, 1'000'000));
  EXPECT_EQ(read.sequence, 3U);
  EXPECT_EQ(read.camera, static_cast<uint32_t>(surface.camera_index));
  EXPECT_EQ(read.stride, 1U);
  ASSERT_EQ(read.faces.size(), triangles.size());
  for (size_t i = 0; i < triangles.size(); ++i) {
    for (size_t k = 0; k < 3; ++k) {
      const auto patch = static_cast<size_t>(triangles[i][k]);
      EXPECT_EQ(read.positions[read.faces[i][k]], surface.Point(patch).cast<float>().eval());
      EXPECT_EQ(read.colors[read.faces[i][k]], surface.rgb[patch]);
    }
  }
}

TEST(PartPreviewTest, KeepsTheLimitTheShapeAndTheDepthStep) {
  const SparseSurface surface = Walls(150, 80);
  for (const int64_t limit : {1, 2, 10, 100, 1000, 5000, 20000}) {
    const Read read = Parse(MakePartPreview(surface, 1, limit));
    EXPECT_LE(static_cast<int64_t>(read.faces.size()), limit);
    EXPECT_EQ(read.faces_of_surface, Triangulate(surface).size());
    if (limit >= 100) {
      EXPECT_GE(static_cast<int64_t>(read.faces.size()), limit / 4);
    }
    std::set<uint32_t> used;
    for (const auto& face : read.faces) {
      std::set<float> depths;
      Eigen::Vector3f corners[3];
      for (size_t k = 0; k < 3; ++k) {
        ASSERT_LT(face[k], read.positions.size());
        used.insert(face[k]);
        corners[k] = read.positions[face[k]];
        depths.insert(std::round(corners[k].z()));
      }
      EXPECT_EQ(depths.size(), 1U) << "a triangle across the depth step";
      // Seen from outside, from the camera at the origin.
      EXPECT_LT((corners[1] - corners[0]).cross(corners[2] - corners[0]).dot(corners[0]), 0);
    }
    EXPECT_EQ(used.size(), read.positions.size()) << "vertices that no triangle uses";
    for (const Eigen::Vector3f& x : read.positions) {
      EXPECT_TRUE((x.array() >= read.smallest.array()).all() && (x.array() <= read.largest.array()).all());
    }
    EXPECT_EQ(MakePartPreview(surface, 1, limit), MakePartPreview(surface, 1, limit));
  }
}

TEST(PartPreviewTest, ClosesHolesThatAreSmallAgainstTheStride) {
  SparseSurface walls = Walls(100, 100);
  PatchLattice holed = walls.ToLattice();
  for (size_t i = 0; i < holed.depth.size(); i += 7) holed.depth[i] = 0;
  for (size_t i = 0; i < holed.depth.size(); ++i) {
    const auto has = [&](size_t j) { return j < holed.depth.size() && holed.depth[j] > 0; };
    if (!has(i) || !has(i + 1)) holed.links[i] &= static_cast<uint8_t>(~PatchLattice::kLinkRight);
    if (!has(i) || !has(i + 100)) holed.links[i] &= static_cast<uint8_t>(~PatchLattice::kLinkDown);
  }
  const Read whole = Parse(MakePartPreview(walls, 1, 300));
  const Read closed = Parse(MakePartPreview(SparseSurface::From(holed), 1, 300));
  ASSERT_EQ(closed.stride, whole.stride);
  EXPECT_EQ(closed.faces, whole.faces);
  EXPECT_LT(closed.faces_of_surface, whole.faces_of_surface);
}

TEST(PartPreviewTest, OfNothingIsAHeader) {
  const Camera camera = {.width = 10, .height = 10, .fx = 10, .fy = 10, .cx = 5, .cy = 5};
  const Read read = Parse(MakePartPreview(SparseSurface::From(PatchLattice::Empty(2, camera, 1)), 9, 10));
  EXPECT_TRUE(read.faces.empty());
  EXPECT_TRUE(read.positions.empty());
}

}  // namespace
}  // namespace meshwright
