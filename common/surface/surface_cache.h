// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "common/base/lru_cache.h"
#include "common/surface/sparse_surface.h"

namespace meshwright {

// Decoded surfaces, by digest.
using SurfaceCache = LruCache<std::string, SparseSurface>;

}  // namespace meshwright
