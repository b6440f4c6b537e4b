// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <list>
#include <memory>
#include <string>
#include <utility>

#include <absl/container/flat_hash_map.h>
#include <absl/status/statusor.h>

#include "common/base/mutex.h"
#include "common/surface/sparse_surface.h"

namespace meshwright {

// Surfaces that are read again and again, decoded once and kept up to a budget, the least recently used going first.
// Thread-safe; two threads that want the same one at the same time may both load it.
class SurfaceCache {
 public:
  using Loader = std::function<absl::StatusOr<SparseSurface>(const std::string& digest)>;

  SurfaceCache(Loader loader, int64_t budget_bytes) : loader_(std::move(loader)), budget_bytes_(budget_bytes) {}

  // The loader's error when it fails; the next call tries again.
  absl::StatusOr<std::shared_ptr<const SparseSurface>> Get(const std::string& digest);

 private:
  struct Entry {
    std::string digest;
    std::shared_ptr<const SparseSurface> surface;
  };

  const Loader loader_;
  const int64_t budget_bytes_;
  Mutex mutex_;
  std::list<Entry> kept_ ABSL_GUARDED_BY(mutex_);  // last used first
  absl::flat_hash_map<std::string, std::list<Entry>::iterator> entry_of_digest_ ABSL_GUARDED_BY(mutex_);
  int64_t kept_bytes_ ABSL_GUARDED_BY(mutex_) = 0;
};

}  // namespace meshwright
