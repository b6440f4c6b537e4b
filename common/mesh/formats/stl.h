// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include <absl/status/status.h>

#include "common/mesh/formats/mesh_rows.h"

namespace meshwright {

// Binary STL (3D Systems, 1988): triangles with their normals, nothing else. It has floats alone: coordinates are
// less the mesh's offset, which the header tells ("Meshwright offset X Y Z"). InvalidArgument for a mesh without faces,
// OutOfRange for more than 2^32 - 1 of them. The file appears whole or not at all.
absl::Status WriteStl(const MeshRows& mesh, const std::string& path);

}  // namespace meshwright
