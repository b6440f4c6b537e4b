// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <memory>

#include <absl/status/statusor.h>

#include "common/surface/sparse_surface.h"

namespace meshwright {

// Gives surface `index` of those that make up the mesh; each is asked for several times. Called by several threads at
// the same time.
using LoadSurface = std::function<absl::StatusOr<std::shared_ptr<const SparseSurface>>(int64_t index)>;

}  // namespace meshwright
