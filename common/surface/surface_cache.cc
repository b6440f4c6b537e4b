// SPDX-License-Identifier: Apache-2.0
#include "common/surface/surface_cache.h"

#include <utility>

#include "common/base/status_macros.h"

namespace meshwright {

absl::StatusOr<std::shared_ptr<const SparseSurface>> SurfaceCache::Get(const std::string& digest) {
  {
    const MutexLock lock(mutex_);
    if (const auto found = entry_of_digest_.find(digest); found != entry_of_digest_.end()) {
      kept_.splice(kept_.begin(), kept_, found->second);
      return kept_.front().surface;
    }
  }
  MW_ASSIGN_OR_RETURN(SparseSurface loaded, loader_(digest));
  auto surface = std::make_shared<const SparseSurface>(std::move(loaded));
  const MutexLock lock(mutex_);
  if (surface->bytes() > budget_bytes_ || entry_of_digest_.contains(digest)) return surface;
  kept_.push_front({digest, surface});
  entry_of_digest_[digest] = kept_.begin();
  kept_bytes_ += surface->bytes();
  while (kept_bytes_ > budget_bytes_) {
    kept_bytes_ -= kept_.back().surface->bytes();
    entry_of_digest_.erase(kept_.back().digest);
    kept_.pop_back();
  }
  return surface;
}

}  // namespace meshwright
