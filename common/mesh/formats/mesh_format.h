// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "common/mesh/formats/mesh_rows.h"

namespace meshwright {

// How a mesh is written.
struct MeshWriteOptions {
  bool compressed = false;  // in formats that have the choice
};

// A format that a mesh can be written in. Every program reads this one table.
struct MeshFormat {
  const char* name;    // "glb": what ?format= takes
  const char* ending;  // ".glb"
  const char* media_type;
  const char* title;  // for people
  const char* note;   // what it keeps
  // The file appears whole or not at all. `path` names the file; it need not have the ending.
  absl::Status (*write)(const MeshRows& mesh, const std::string& path, const MeshWriteOptions& options);
  bool textured = false;      // can carry a texture atlas
  bool has_folder = false;    // a folder beside the file has the rest of it: nothing to be sent as one file
  bool compressible = false;  // by EXT_meshopt_compression
};

// PLY, what a reconstruction writes by itself, is the first.
const std::vector<MeshFormat>& MeshFormats();

// By the ending of a file's name, whatever the case. InvalidArgument tells the endings that there are.
absl::StatusOr<const MeshFormat*> MeshFormatOfPath(const std::string& path);
// By name, of those that are one file. InvalidArgument tells the names that there are.
absl::StatusOr<const MeshFormat*> MeshFormatByName(const std::string& name);
// ".ply, .glb, ...".
std::string MeshFormatEndings();
// InvalidArgument when the format knows no compression that was asked for; `path` is named.
absl::Status CheckCompressible(const MeshFormat& format, const MeshWriteOptions& options, const std::string& path);
bool IsPly(const MeshFormat& format);

// {"formats": [{"name": "ply", ...}, ...]}, those that are one file, for services to offer.
std::string DescribeMeshFormats();

// Writes the mesh of a PLY file in another format, in memory that does not grow with the mesh when the file is one of
// ours. `points`: its vertices alone. Errors: those of MeshRows::OpenPly and of the format.
absl::Status ConvertPly(const std::string& ply_path, const MeshFormat& format, bool points, const std::string& path,
                        const MeshWriteOptions& options = {});

}  // namespace meshwright
