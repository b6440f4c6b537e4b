// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <string>

#include <absl/status/statusor.h>

#include "common/base/thread_pool.h"
#include "common/scene/scene.h"

namespace meshwright {

// Reads and decodes every photograph once, so that a truncated one is named before hours of work and not after, and
// returns the digest of the whole scene: names, cameras, sparse points and the photographs' bytes, but not where they
// are. `checked(n)` is called after each photograph, from any thread, one call at a time. Errors are bad input.
absl::StatusOr<std::string> CheckAndDigestScene(const Scene& scene, ThreadPool& pool,
                                                const std::function<void(int n)>& checked);

}  // namespace meshwright
