// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <list>
#include <memory>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "common/base/mutex.h"
#include "common/blob/blob_store.h"
#include "common/scene/scene.h"
#include "worker/camera_job/camera_job.h"
#include "worker/job_input/camera_job_input.h"
#include "worker/job_input/view_cache.h"

namespace meshwright {

// What a reconstruction's options mean for a worker.
struct JobConfig {
  int max_image_size = 0;  // px, 0: as they are
  CameraJobOptions job;
};

// InvalidArgument names the option.
using JobConfigParser = std::function<absl::StatusOr<JobConfig>(const std::string& options_json)>;

// What the jobs of one reconstruction share.
struct JobContext {
  JobConfig config;
  Scene scene;  // each image_path is the digest of the picture's blob
  std::vector<Camera> cameras;
  std::unique_ptr<ViewCache> views;
  std::unique_ptr<CameraJobInputMaker> inputs;
};

// The contexts of the last reconstructions that this worker had jobs of. Thread-safe.
class JobContexts {
 public:
  // `cache_bytes`: for decoded photographs that no job uses at the moment, of each reconstruction.
  JobContexts(BlobStore& blobs, JobConfigParser parse, int64_t cache_bytes);

  // Errors are the BlobStore's and the parser's.
  // `reduction`: how many times the jobs were made smaller; each doubles the spacing of the lattice.
  absl::StatusOr<std::shared_ptr<const JobContext>> For(const std::string& scene_digest,
                                                        const std::string& options_json, int reduction);

 private:
  absl::StatusOr<std::shared_ptr<const JobContext>> Make(const std::string& scene_digest,
                                                         const std::string& options_json, int reduction);

  struct Kept {
    std::string key;
    std::shared_ptr<const JobContext> context;
  };
  BlobStore& blobs_;
  const JobConfigParser parse_;
  const int64_t cache_bytes_;
  Mutex mutex_;
  std::list<Kept> kept_ ABSL_GUARDED_BY(mutex_);  // the last one used first
};

}  // namespace meshwright
