// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <string>

#include <absl/status/status.h>

#include "common/mesh/formats/mesh_rows.h"

namespace meshwright {

struct TilesetOptions {
  size_t max_tile_faces = 65'536;  // of a leaf
  bool compressed = false;         // contents by EXT_meshopt_compression
};

// Writes a tileset of 3D Tiles 1.1 (Open Geospatial Consortium 22-025r4) for meshes that are too large for one file:
// `path`, JSON, describes an octree of GLB files, which lie beside it in a folder of its name: DIR/NAME.json,
// DIR/NAME.tiles/r.glb, r0.glb, ... Leaves have the mesh's own faces, at most `max_tile_faces`; what is above them has
// half of that, or what its border needs: a tile's border is the mesh's own, so that neighbours fit together whatever
// their levels of detail. A tile replaces its parent (refine: REPLACE) where the parent's geometric error, the
// distance by which its vertices may be off in scene units, would be seen.
//
// Tiles are Z up while a scene's Y points down, and contents are glTF, Y up: (x, y, z) of the scene is (x, z, -y) of
// the tileset. Where the mesh has an offset, coordinates are a surveyor's: root.transform turns back and adds it.
//
// Positions are the mesh's own floats. Compressed ones are of 16 bits, on lattices that fit into each other, and that
// of a vertex on a border is the one of the coarsest tile which has it there: tiles fit together all the same.
//
// One tile and its children are in memory; 16 bytes for each face and 8 for each vertex are in scratch files. DIR is
// made. Contents come first and `path` last; what was there under the same names is replaced. InvalidArgument without
// faces, and when the folder of contents has files of somebody else.
absl::Status WriteTileset(const MeshRows& mesh, const std::string& path, const TilesetOptions& options = {});

}  // namespace meshwright
