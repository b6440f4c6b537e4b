// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>

#include "common/surface/sparse_surface.h"

namespace meshwright {

// An accepted surface for browsers, with at most `max_faces` (>= 1) triangles, in the layout that the OpenAPI file
// draws. With stride 1 they are those of the surface. With larger ones, each block of stride x stride nodes stands for
// its patch nearest to its middle, and neighbouring blocks are one surface when their patches hang together in the
// whole surface and no depth step lies between them: small holes close, depth steps stay. Taken is the first stride
// from sqrt(triangles / max_faces), rounded down, that keeps the limit. A function of its arguments alone.
std::string MakePartPreview(const SparseSurface& surface, int32_t sequence, int64_t max_faces);

}  // namespace meshwright
