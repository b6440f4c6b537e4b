// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>

#include <absl/status/statusor.h>

#include "common/base/ids.h"
#include "common/base/mutex.h"
#include "common/image/color_image.h"
#include "common/image/sampling_image.h"
#include "common/scene/view.h"

namespace meshwright {

// Levels of the pyramid that jobs sample from. Feasible pairs see a surface at about the same scale; only views that
// come much nearer than that use the upper levels.
constexpr int kSamplingLevels = 3;

// Bytes of a SamplingImage with kSamplingLevels levels of an image of this size.
int64_t SamplingImageBytes(int width, int height);

// Grey views shared by the jobs of one process: decoded once as long as somebody uses them, and kept afterwards up to a
// budget, the least recently used going first. So memory depends on the jobs that run and on the budget, never on how
// many views the scene has. Thread-safe; two threads that want the same view at the same time decode it once.
class ViewCache {
 public:
  using Loader = std::function<absl::StatusOr<View>(CameraIndex camera)>;

  ViewCache(Loader loader, int64_t budget_bytes);

  // The loader's error when it fails; the next call tries again.
  absl::StatusOr<std::shared_ptr<const SamplingImage>> Grey(CameraIndex camera);

  struct Reference {
    std::shared_ptr<const SamplingImage> grey;
    std::shared_ptr<const ColorImage> color;  // never kept: one job needs it, once
  };
  absl::StatusOr<Reference> GreyAndColor(CameraIndex camera);

  int64_t decoded_views() const;

 private:
  struct Entry {
    std::shared_ptr<const SamplingImage> kept;
    std::weak_ptr<const SamplingImage> used;  // finds it while a job holds it although it is not kept any more
    int64_t last_use = 0;
    bool loading = false;
  };

  // Nullptr when it has to be loaded.
  std::shared_ptr<const SamplingImage> Find(CameraIndex camera) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void Keep(CameraIndex camera, const std::shared_ptr<const SamplingImage>& grey) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  const Loader loader_;
  const int64_t budget_bytes_;
  mutable Mutex mutex_;
  ConditionVariable loaded_;
  std::map<CameraIndex, Entry> entries_ ABSL_GUARDED_BY(mutex_);
  int64_t kept_bytes_ ABSL_GUARDED_BY(mutex_) = 0;
  int64_t uses_ ABSL_GUARDED_BY(mutex_) = 0;
  int64_t decoded_views_ ABSL_GUARDED_BY(mutex_) = 0;
};

}  // namespace meshwright
