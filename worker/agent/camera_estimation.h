// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <string>

#include <absl/status/statusor.h>

#include "meshwright/v1/worker.pb.h"

#include "common/blob/blob_store.h"
#include "common/scene/scene.h"
#include "worker/job_input/run_job.h"

namespace meshwright {

// What a worker that can estimate cameras brings.
struct CameraEstimator {
  struct Job {
    std::string photographs;  // a folder
    std::string scene;        // a folder to work in; what an earlier process did there is not done again
    int threads = 1;
    std::function<bool()> stop;  // asked now and then
    std::function<void(const std::string& step, double fraction)> progress;
  };
  struct Result {
    Scene scene;              // each image_path is the photograph's path relative to its folder
    std::string report_json;  // how many photographs got a camera, and what should be photographed better
  };
  std::string colmap_version;  // "": it cannot
  // Bad input or FailedPrecondition: these photographs give no cameras, whoever tries. Cancelled: stopped.
  std::function<absl::StatusOr<Result>(const Job& job)> estimate;
};

// One job from the photographs' blobs to the scene's: job.photographs are laid out in a folder below `work_folder` that
// their names and bytes name, so that the next process of this machine goes on there. It is removed at the end.
absl::StatusOr<FinishedJob> EstimateCamerasOf(const v1::CameraJob& job, const CameraEstimator& estimator,
                                              BlobStore& blobs, const std::string& work_folder, int threads,
                                              const std::function<bool()>& stop,
                                              const std::function<void(const std::string&, double)>& progress);

}  // namespace meshwright
