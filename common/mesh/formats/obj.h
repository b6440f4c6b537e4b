// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include <absl/status/status.h>

#include "common/mesh/formats/mesh_rows.h"

namespace meshwright {

// Wavefront OBJ: "v x y z r g b" (colours 0..1 behind the position, as MeshLab, CloudCompare and Blender read them),
// "vn", and faces. Numbers have the digits that give back the same float. The file appears whole or not at all.
absl::Status WriteObj(const MeshRows& mesh, const std::string& path);

}  // namespace meshwright
