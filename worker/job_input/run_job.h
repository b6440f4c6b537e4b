// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "common/base/thread_pool.h"
#include "common/blob/blob_store.h"
#include "common/job/camera_job_spec.h"
#include "common/scene/scene.h"
#include "worker/camera_job/camera_job.h"
#include "worker/job_input/camera_job_input.h"

namespace meshwright {

// What does a camera job; RunCameraJob, or something quick in tests.
using CameraJobFunction = std::function<CameraJobResult(const CameraJobInput&, ThreadPool&)>;

// What the coordinator is told about a job.
struct FinishedJob {
  std::string filtered_digest;  // F_r, durable in the BlobStore
  std::vector<CameraIndex> weak_targets;
  std::string report_json;
  CameraJobReport report;
};

// One job from its specification to a durable surface, the same in one process and in a cluster. Errors: bad input (a
// photograph cannot be used), or the BlobStore's.
absl::StatusOr<FinishedJob> RunJob(const Scene& scene, const CameraJobSpec& spec, const CameraJobInputMaker& inputs,
                                   const CameraJobFunction& job, BlobStore& blobs, ThreadPool& pool);

}  // namespace meshwright
