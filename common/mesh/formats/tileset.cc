// SPDX-License-Identifier: Apache-2.0
#include "common/mesh/formats/tileset.h"

#include <algorithm>
#include <filesystem>
#include <limits>
#include <system_error>
#include <vector>

#include <absl/strings/ascii.h>
#include <absl/strings/str_cat.h>
#include <nlohmann/json.hpp>

#include "common/base/files.h"
#include "common/base/status_macros.h"
#include "common/json/json_text.h"
#include "common/mesh/formats/glb.h"
#include "common/mesh/formats/glb_compression.h"
#include "common/mesh/formats/tile_mesh.h"
#include "common/mesh/formats/tile_tree.h"

namespace meshwright {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr char kContentEnding[] = ".glb";

// A box along the scene's axes in those of the tileset: its centre, and half of each of its edges.
Json DescribeBox(const Eigen::AlignedBox3d& box) {
  const Eigen::Vector3d c = box.center();
  const Eigen::Vector3d half = box.sizes() / 2;
  return {{"box", {c.x(), c.z(), -c.y(), half.x(), 0.0, 0.0, 0.0, half.z(), 0.0, 0.0, 0.0, half.y()}}};
}

// From the tileset's axes to the scene's, column by column.
Json DescribeTransform(const Eigen::Vector3d& offset) {
  return {1, 0, 0, 0, 0, 0, 1, 0, 0, -1, 0, 0, offset.x(), offset.y(), offset.z(), 1};
}

// Tiles from the leaves up, with what tileset.json says of each.
class TileWriter {
 public:
  TileWriter(const MeshRows& mesh, const TileTree& tree, const TilesetOptions& options, std::string folder,
             std::string uri)
      : mesh_(mesh),
        tree_(tree),
        options_(options),
        folder_(std::move(folder)),
        uri_(std::move(uri)),
        descriptions_(tree.tiles().size()) {}

  // Writes the tile's content and those below it.
  absl::StatusOr<TileMesh> Write(size_t number) {
    const Tile& tile = tree_.tiles()[number];
    std::vector<TileMesh> children;
    for (const size_t child : tile.children) {
      MW_ASSIGN_OR_RETURN(children.emplace_back(), Write(child));
    }
    TileMesh mesh =
        tile.is_leaf() ? LeafMesh(mesh_, tree_, tile) : ParentMesh(children, tree_, tile, options_.max_tile_faces / 2);
    MW_RETURN_IF_ERROR(WriteContent(tile, mesh));
    Describe(tile, mesh, descriptions_[number]);
    return mesh;
  }

  Json& description(size_t number) { return descriptions_[number]; }

 private:
  // Of 16 bits where faces do not reach far out of the cube; floats where they do.
  glb::PositionLattice LatticeOf(const Tile& tile, const Eigen::AlignedBox3d& box) const {
    const double step = tree_.LatticeStep(tile.depth);
    // Vertices of the border are on coarser lattices, the coarsest of which is that of the root's children.
    const double margin = tree_.LatticeStep(1);
    if ((box.sizes().maxCoeff() + 2 * margin) / step > std::numeric_limits<uint16_t>::max() - 1) return {};
    return {.origin = ((box.min().array() - margin) / step).floor() * step, .step = step};
  }

  absl::Status WriteContent(const Tile& tile, const TileMesh& shown) const {
    const std::string path = folder_ + "/" + tile.name + kContentEnding;
    if (options_.compressed && !shown.faces.empty()) {
      const glb::PositionLattice lattice = LatticeOf(tile, shown.box);
      return glb::WriteCompressed({.positions = SnappedPositions(shown, tree_, tile),
                                   .normals = {},
                                   .colors = shown.colors,
                                   .texture_coordinates = {},
                                   .faces = shown.faces},
                                  lattice, Eigen::Vector3d::Zero(), path);
    }
    TriangleMesh mesh;
    mesh.positions = shown.positions;
    mesh.colors = shown.colors;
    mesh.faces = shown.faces;
    return WriteGlb(mesh, path);
  }

  // By as much for every tile, so that children stay in their parents.
  Eigen::AlignedBox3d GrownByRounding(const Eigen::AlignedBox3d& box) const {
    const Eigen::Vector3d most = Eigen::Vector3d::Constant(tree_.LatticeStep(0) / 2);
    return {box.min() - most, box.max() + most};
  }

  void Describe(const Tile& tile, const TileMesh& mesh, Json& description) {
    description["boundingVolume"] = DescribeBox(options_.compressed ? GrownByRounding(mesh.box) : mesh.box);
    description["geometricError"] = mesh.error;
    description["refine"] = "REPLACE";
    description["content"] = {{"uri", absl::StrCat(uri_, "/", tile.name, kContentEnding)}};
    for (const size_t child : tile.children) description["children"].push_back(std::move(descriptions_[child]));
  }

  const MeshRows& mesh_;
  const TileTree& tree_;
  const TilesetOptions options_;
  const std::string folder_;
  const std::string uri_;  // of the folder, from tileset.json
  std::vector<Json> descriptions_;
};

// DIR/NAME.json -> NAME.tiles, with letters that need no escape in a URI.
std::string ContentFolderName(const std::string& path) {
  std::string name = fs::path(path).stem().string();
  for (char& c : name) {
    if (!absl::ascii_isalnum(static_cast<unsigned char>(c)) && c != '-' && c != '.') c = '_';
  }
  return name + ".tiles";
}

absl::Status SystemError(const std::string& path, const std::error_code& error) {
  return absl::InternalError(absl::StrCat(path, ": ", error.message()));
}

// An earlier tileset may be replaced, and nothing else.
absl::Status CheckReplaceable(const std::string& path, const fs::path& folder) {
  std::error_code error;
  if (fs::exists(path, error) && !fs::is_regular_file(path, error)) {
    return absl::InvalidArgumentError(absl::StrCat(path, ": cannot be replaced, it is no regular file"));
  }
  if (!fs::exists(folder, error)) return absl::OkStatus();
  for (const auto& entry : fs::directory_iterator(folder, error)) {
    if (entry.path().extension() == kContentEnding) continue;
    return absl::InvalidArgumentError(
        absl::StrCat(entry.path().string(), " is in the way, expected no files but ", kContentEnding));
  }
  return error ? SystemError(folder.string(), error) : absl::OkStatus();
}

// The folder that contents are written to until all are there.
class PartialFolder {
 public:
  explicit PartialFolder(const std::string& path) : path_(PartialPath(path)) {}
  ~PartialFolder() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
  }
  PartialFolder(const PartialFolder&) = delete;
  PartialFolder& operator=(const PartialFolder&) = delete;
  const std::string& path() const { return path_; }

 private:
  const std::string path_;
};

absl::Status ReplaceFolder(const std::string& from, const fs::path& to) {
  std::error_code error;
  fs::remove_all(to, error);
  if (!error) fs::rename(from, to, error);
  return error ? SystemError(to.string(), error) : absl::OkStatus();
}

}  // namespace

absl::Status WriteTileset(const MeshRows& mesh, const std::string& path, const TilesetOptions& options) {
  if (mesh.faces() == 0) {
    return absl::InvalidArgumentError(absl::StrCat(path, ": the mesh has 0 faces, 3D Tiles expect at least 1"));
  }
  const std::string folder_name = ContentFolderName(path);
  const fs::path folder = fs::path(path).parent_path() / folder_name;
  MW_RETURN_IF_ERROR(CheckReplaceable(path, folder));
  const PartialFolder partial(folder.string());
  std::error_code error;
  fs::create_directories(partial.path(), error);
  if (error) return SystemError(partial.path(), error);

  MW_ASSIGN_OR_RETURN(const TileTree tree, TileTree::Build(mesh, options.max_tile_faces, partial.path()));
  TileWriter writer(mesh, tree, options, partial.path(), folder_name);
  MW_ASSIGN_OR_RETURN(const TileMesh root, writer.Write(0));
  if (mesh.has_offset()) writer.description(0)["transform"] = DescribeTransform(mesh.offset());
  const Json tileset = {{"asset", {{"version", "1.1"}, {"generator", "Meshwright"}}},
                        {"geometricError", root.box.sizes().norm()},
                        {"root", std::move(writer.description(0))}};
  // What is there of an earlier tileset does not fit the new contents.
  fs::remove(path, error);
  MW_RETURN_IF_ERROR(ReplaceFolder(partial.path(), folder));
  return WriteFileAtomically(path, JsonText(tileset) + "\n");
}

}  // namespace meshwright
