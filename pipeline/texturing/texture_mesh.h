// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include <absl/status/statusor.h>
#include <nlohmann/json.hpp>

#include "pipeline/texturing/texture_options.h"

#include "common/base/thread_pool.h"
#include "common/mesh/formats/mesh_format.h"
#include "common/mesh/triangle_mesh.h"
#include "common/scene/scene.h"

namespace meshwright {

struct TextureReport {
  double footprint = 0;  // median g, scene units
  int64_t vertices = 0;  // of the textured mesh, before it is cut at seams
  int64_t faces = 0;
  int64_t faces_unseen = 0;  // by any photograph: they have the colours of their vertices
  int64_t charts = 0;
  int64_t pages = 0;
  int64_t page_pixels = 0;
  double seam_jump_photographs = 0;  // mean difference across seams, grey levels: as photographed,
  double seam_jump_leveled = 0;      // and with colours levelled globally; the rest is closed pixel by pixel
};
nlohmann::ordered_json ToJson(const TextureReport& report);

// What can be told while it goes on: photographs looked at, of all that there are to look at (three times each).
using TextureProgress = std::function<void(int done, int total)>;

// Writes the mesh, simplified, with a texture atlas cut from the scene's photographs (Waechter, Moehrle, Goesele: Let
// There Be Color!, 2014) in a format that carries one. `prepared`, when not null, gets the mesh without its texture.
//
// One photograph and two pages are in memory at a time, beside some 300 bytes for each face of the simplified mesh and
// the mesh that came in. The bytes depend on the arguments alone, not on the threads. Errors: those of LoadView and of
// the files, InvalidArgument for options, FailedPrecondition when no photograph shows anything of the mesh.
absl::StatusOr<TextureReport> WriteTexturedMesh(
    TriangleMesh mesh, const Scene& scene, const TextureOptions& options, const MeshFormat& format,
    const std::string& path, ThreadPool& pool, const TextureProgress& progress = [](int, int) {},
    TriangleMesh* prepared = nullptr);

}  // namespace meshwright
