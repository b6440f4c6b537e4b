// SPDX-License-Identifier: Apache-2.0
#include "worker/agent/job_contexts.h"

#include <utility>

#include <absl/strings/str_cat.h>

#include "common/base/status_macros.h"
#include "common/scene/scene_codec.h"
#include "common/scene/view.h"
#include "worker/job_input/blob_views.h"

namespace meshwright {
namespace {

constexpr size_t kMaxKept = 3;

}  // namespace

JobContexts::JobContexts(BlobStore& blobs, JobConfigParser parse, int64_t cache_bytes)
    : blobs_(blobs), parse_(std::move(parse)), cache_bytes_(cache_bytes) {}

absl::StatusOr<std::shared_ptr<const JobContext>> JobContexts::For(const std::string& scene_digest,
                                                                   const std::string& options_json, int reduction) {
  const std::string key = absl::StrCat(scene_digest, " ", reduction, " ", options_json);
  // Two jobs that want the same scene at the same time load it once; others wait, which is rare.
  const MutexLock lock(mutex_);
  for (auto it = kept_.begin(); it != kept_.end(); ++it) {
    if (it->key != key) continue;
    kept_.splice(kept_.begin(), kept_, it);
    return it->context;
  }
  MW_ASSIGN_OR_RETURN(std::shared_ptr<const JobContext> context, Make(scene_digest, options_json, reduction));
  kept_.push_front({key, context});
  if (kept_.size() > kMaxKept) kept_.pop_back();
  return context;
}

absl::StatusOr<std::shared_ptr<const JobContext>> JobContexts::Make(const std::string& scene_digest,
                                                                    const std::string& options_json, int reduction) {
  auto context = std::make_shared<JobContext>();
  MW_ASSIGN_OR_RETURN(context->config, parse_(options_json));
  context->config.job = Reduced(context->config.job, reduction);
  MW_ASSIGN_OR_RETURN(const std::string bytes, blobs_.Get(scene_digest));
  MW_ASSIGN_OR_RETURN(context->scene, DecodeScene(bytes));
  const int max_image_size = context->config.max_image_size;
  for (const SceneView& view : context->scene.views) {
    context->cameras.push_back(UndistortedCamera(view, max_image_size));
  }
  const auto load = [&blobs = blobs_, &scene = context->scene, max_image_size](CameraIndex camera) {
    return LoadViewFromBlobs(scene.views[static_cast<size_t>(camera)], max_image_size, blobs);
  };
  context->views = std::make_unique<ViewCache>(load, cache_bytes_);
  context->inputs = std::make_unique<CameraJobInputMaker>(context->scene, context->cameras, *context->views, blobs_,
                                                          context->config.job.lattice_step);
  return context;
}

}  // namespace meshwright
