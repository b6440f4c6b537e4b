// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include <absl/status/status.h>

#include "common/mesh/formats/mesh_rows.h"

namespace meshwright {

// LAS 1.2 (ASPRS, 2008), point data record format 2: the vertices with their colours, black when the mesh has none.
// Coordinates are whole multiples of a power of ten that is at most 2^-30 of the extent, from the rounded centre.
// InvalidArgument for a mesh without vertices, OutOfRange for more than 2^32 - 1 of them. The file appears whole or not
// at all.
absl::Status WriteLas(const MeshRows& mesh, const std::string& path);

}  // namespace meshwright
