// SPDX-License-Identifier: Apache-2.0
#include "worker/job_input/view_cache.h"

#include <utility>

#include "common/base/status_macros.h"

namespace meshwright {

int64_t SamplingImageBytes(int width, int height) {
  int64_t bytes = 0;
  for (int level = 0; level < kSamplingLevels; ++level) {
    bytes += int64_t{4} * (width >> level) * (height >> level);
  }
  return bytes;
}

ViewCache::ViewCache(Loader loader, int64_t budget_bytes) : loader_(std::move(loader)), budget_bytes_(budget_bytes) {}

std::shared_ptr<const SamplingImage> ViewCache::Find(CameraIndex camera) {
  Entry& entry = entries_[camera];
  std::shared_ptr<const SamplingImage> grey = entry.used.lock();
  if (grey != nullptr) Keep(camera, grey);
  return grey;
}

void ViewCache::Keep(CameraIndex camera, const std::shared_ptr<const SamplingImage>& grey) {
  Entry& entry = entries_[camera];
  if (entry.kept == nullptr) kept_bytes_ += grey->bytes();
  entry.kept = grey;
  entry.used = grey;
  entry.last_use = ++uses_;
  while (kept_bytes_ > budget_bytes_) {
    auto oldest = entries_.end();
    for (auto it = entries_.begin(); it != entries_.end(); ++it) {
      if (it->second.kept == nullptr) continue;
      if (oldest == entries_.end() || it->second.last_use < oldest->second.last_use) oldest = it;
    }
    kept_bytes_ -= oldest->second.kept->bytes();
    oldest->second.kept.reset();
  }
}

absl::StatusOr<std::shared_ptr<const SamplingImage>> ViewCache::Grey(CameraIndex camera) {
  {
    MutexLock lock(mutex_);
    while (true) {
      if (auto grey = Find(camera); grey != nullptr) return grey;
      if (!entries_[camera].loading) break;
      loaded_.Wait(lock);
    }
    entries_[camera].loading = true;
  }
  absl::StatusOr<View> view = loader_(camera);
  std::shared_ptr<const SamplingImage> grey;
  if (view.ok())
    grey = std::make_shared<const SamplingImage>(ToGrey(view->color), kSamplingLevels, std::move(view->ignored));
  {
    const MutexLock lock(mutex_);
    entries_[camera].loading = false;
    if (grey != nullptr) {
      ++decoded_views_;
      Keep(camera, grey);
    }
  }
  loaded_.NotifyAll();
  if (grey == nullptr) return view.status();
  return grey;
}

absl::StatusOr<ViewCache::Reference> ViewCache::GreyAndColor(CameraIndex camera) {
  MW_ASSIGN_OR_RETURN(View view, loader_(camera));
  Reference reference;
  {
    const MutexLock lock(mutex_);
    ++decoded_views_;
    reference.grey = Find(camera);
  }
  if (reference.grey == nullptr) {
    reference.grey =
        std::make_shared<const SamplingImage>(ToGrey(view.color), kSamplingLevels, std::move(view.ignored));
    const MutexLock lock(mutex_);
    Keep(camera, reference.grey);
  }
  reference.color = std::make_shared<const ColorImage>(std::move(view.color));
  return reference;
}

int64_t ViewCache::decoded_views() const {
  const MutexLock lock(mutex_);
  return decoded_views_;
}

}  // namespace meshwright
