// SPDX-License-Identifier: Apache-2.0
#include "common/mesh/formats/tile_mesh.h"

#include <algorithm>
#include <limits>
#include <map>
#include <memory>
#include <set>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "common/base/temporary_folder_testing.h"
#include "common/mesh/surface_mesh.h"
#include "common/surface/random_surface_testing.h"

namespace meshwright {
namespace {

constexpr size_t kMaxFaces = 400;
using Edge = std::pair<uint32_t, uint32_t>;

// All tiles of a mesh with holes, some 16,000 faces.
class TileMeshTest : public testing::Test {
 protected:
  TileMeshTest() : mesh_(MeshOfSurface(RandomSurface(5, SmallCamera(120, 90), 1, 0.95, 0.95))), rows_(mesh_) {
    tree_ = std::make_unique<TileTree>(*TileTree::Build(rows_, kMaxFaces, folder_ / "x"));
    tiles_.resize(tree_->tiles().size());
    for (size_t t = tiles_.size(); t-- > 0;) {
      const Tile& tile = tree_->tiles()[t];
      std::vector<TileMesh> children;
      for (const size_t child : tile.children) children.push_back(tiles_[child]);
      tiles_[t] = tile.is_leaf() ? LeafMesh(rows_, *tree_, tile) : ParentMesh(children, *tree_, tile, kMaxFaces / 2);
    }
  }

  const Tile& tile(size_t t) const { return tree_->tiles()[t]; }
  bool IsIn(size_t t, size_t place) const { return tile(t).begin <= place && place < tile(t).end; }

  const TemporaryFolder folder_;
  const TriangleMesh mesh_;
  const MeshRows rows_;
  std::unique_ptr<TileTree> tree_;
  std::vector<TileMesh> tiles_;
};

TEST_F(TileMeshTest, LeavesHaveEveryFaceOnce) {
  std::multiset<std::array<uint32_t, 3>> expected(mesh_.faces.begin(), mesh_.faces.end());
  std::multiset<std::array<uint32_t, 3>> found;
  int deepest = 0;
  for (size_t t = 0; t < tiles_.size(); ++t) {
    if (!tile(t).is_leaf()) continue;
    const TileMesh& leaf = tiles_[t];
    EXPECT_LE(leaf.faces.size(), kMaxFaces);
    EXPECT_EQ(leaf.error, 0);
    deepest = std::max(deepest, tile(t).depth);
    for (const auto& face : leaf.faces) {
      found.insert({leaf.vertices[face[0]], leaf.vertices[face[1]], leaf.vertices[face[2]]});
    }
    for (size_t v = 0; v < leaf.positions.size(); ++v) {
      ASSERT_EQ(leaf.positions[v], mesh_.positions[leaf.vertices[v]]);
      ASSERT_EQ(leaf.colors[v], mesh_.colors[leaf.vertices[v]]);
    }
  }
  EXPECT_GE(deepest, 3);
  EXPECT_EQ(found, expected);
}

TEST_F(TileMeshTest, EveryTileKeepsTheBorderToWhatIsOutside) {
  std::map<Edge, size_t> place_of_edge;  // the face that an edge belongs to
  for (size_t place = 0; place < mesh_.faces.size(); ++place) {
    const auto& face = mesh_.faces[tree_->FaceAt(place)];
    for (size_t k = 0; k < 3; ++k) place_of_edge[{face[k], face[(k + 1) % 3]}] = place;
  }
  size_t border_edges = 0;
  for (size_t t = 0; t < tiles_.size(); ++t) {
    std::set<Edge> edges;
    const TileMesh& shown = tiles_[t];
    for (const auto& face : shown.faces) {
      for (size_t k = 0; k < 3; ++k) edges.insert({shown.vertices[face[k]], shown.vertices[face[(k + 1) % 3]]});
    }
    for (const auto& [edge, place] : place_of_edge) {
      const auto across = place_of_edge.find({edge.second, edge.first});
      if (across == place_of_edge.end() || !IsIn(t, place) || IsIn(t, across->second)) continue;
      EXPECT_TRUE(edges.count(edge) == 1) << tile(t).name;
      ++border_edges;
    }
    for (size_t v = 0; v < shown.positions.size(); ++v) {
      if (shown.vertices[v] == TileMesh::kNoVertex) continue;
      ASSERT_EQ(shown.positions[v], mesh_.positions[shown.vertices[v]]);
    }
  }
  EXPECT_GT(border_edges, 1000U);
}

TEST_F(TileMeshTest, CommonDepthIsThatOfTheSmallestTileWithAllFaces) {
  std::vector<std::pair<size_t, size_t>> range(mesh_.positions.size(), {SIZE_MAX, 0});  // of a vertex's faces
  for (size_t place = 0; place < mesh_.faces.size(); ++place) {
    for (const uint32_t v : mesh_.faces[tree_->FaceAt(place)]) {
      range[v] = {std::min(range[v].first, place), std::max(range[v].second, place)};
    }
  }
  for (size_t t = 0; t < tiles_.size(); ++t) {
    for (const uint32_t v : tiles_[t].vertices) {
      if (v == TileMesh::kNoVertex) continue;
      const bool all_inside = IsIn(t, range[v].first) && IsIn(t, range[v].second);
      EXPECT_EQ(tree_->CommonDepth(v) >= tile(t).depth, all_inside);
    }
  }
}

TEST_F(TileMeshTest, ParentsHaveFewerFacesAndAnErrorThatHolds) {
  for (size_t t = 0; t < tiles_.size(); ++t) {
    if (tile(t).is_leaf()) continue;
    size_t below = 0;
    for (const size_t child : tile(t).children) {
      below += tiles_[child].faces.size();
      EXPECT_LE(tiles_[child].error, tiles_[t].error);
      EXPECT_TRUE(tiles_[t].box.contains(tiles_[child].box));
    }
    EXPECT_LT(tiles_[t].faces.size(), below);
    EXPECT_GT(tiles_[t].error, 0);
    EXPECT_LE(tiles_[t].error, tree_->CubeSize(tile(t).depth));
    std::vector<Eigen::Vector3f> inside;
    for (size_t place = tile(t).begin; place < tile(t).end; ++place) {
      for (const uint32_t v : mesh_.faces[tree_->FaceAt(place)]) inside.push_back(mesh_.positions[v]);
    }
    for (const Eigen::Vector3f& x : tiles_[t].positions) {
      float nearest = std::numeric_limits<float>::max();
      for (const Eigen::Vector3f& y : inside) nearest = std::min(nearest, (x - y).norm());
      EXPECT_LE(nearest, tiles_[t].error + 1e-6);
      EXPECT_TRUE(tiles_[t].box.contains(x.cast<double>()));
    }
    for (const auto& face : tiles_[t].faces) {
      EXPECT_TRUE(face[0] != face[1] && face[1] != face[2] && face[2] != face[0]);
    }
  }
}

TEST_F(TileMeshTest, SnappedBordersAreTheSameInAllTiles) {
  std::map<uint32_t, Eigen::Vector3f> border;
  size_t met_again = 0;
  for (size_t t = 0; t < tiles_.size(); ++t) {
    const std::vector<Eigen::Vector3f> snapped = SnappedPositions(tiles_[t], *tree_, tile(t));
    for (size_t v = 0; v < snapped.size(); ++v) {
      const double step = tree_->LatticeStep(tile(t).depth);
      const Eigen::Vector3d multiples = snapped[v].cast<double>() / step;
      EXPECT_EQ(multiples, Eigen::Vector3d(multiples.array().round()));
      EXPECT_LE((snapped[v] - tiles_[t].positions[v]).norm(), tree_->LatticeStep(0));
      if (tiles_[t].common_depth[v] >= tile(t).depth) continue;
      const auto [known, is_new] = border.try_emplace(tiles_[t].vertices[v], snapped[v]);
      EXPECT_EQ(known->second, snapped[v]);
      if (!is_new) ++met_again;
    }
  }
  EXPECT_GT(met_again, 1000U);
}

TEST_F(TileMeshTest, AMeshOfOnePointIsOneLeaf) {
  TriangleMesh point;
  point.positions.assign(3, Eigen::Vector3f::Constant(7));
  point.faces.assign(5, {0, 1, 2});
  const MeshRows rows(point);
  const TileTree tree = *TileTree::Build(rows, 2, folder_ / "x");
  EXPECT_EQ(tree.tiles().size(), static_cast<size_t>(TileTree::kMaxDepth + 1));
  EXPECT_EQ(LeafMesh(rows, tree, tree.tiles().back()).faces.size(), 5U);
}

}  // namespace
}  // namespace meshwright
