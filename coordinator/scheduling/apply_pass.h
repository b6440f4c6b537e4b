// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <set>
#include <string>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <absl/time/time.h>

#include "common/job/camera_job_spec.h"
#include "coordinator/scheduling/scheduling_pass.h"
#include "coordinator/store/job_store.h"

namespace meshwright {

// What has come of a pass.
struct AppliedPass {
  std::set<std::string> news;  // reconstructions with new results, or blobs that could not be read
  struct Claim {
    std::string reconstruction;
    CameraJob job;  // with its specification
  };
  std::vector<Claim> claims;
  absl::Status refusal;  // of the first result that the store did not take; OK: there is none
};

// Writes what the pass has decided, and heartbeats, to the store in one transaction, and tells the pass what became of
// it. A result that the store does not take is a failure of its job. Errors are the store's.
absl::StatusOr<AppliedPass> ApplyPass(SchedulingPass& pass, const std::vector<WorkerRecord>& heartbeats,
                                      JobStore& store, absl::Time now);

// As the store's job specifications say. `store` outlives it.
SchedulingPass::MemorySteps MemoryStepsOf(JobStore& store);

// What a worker needs to know of a job that it was given. DataLoss when what is stored is no specification.
absl::StatusOr<CameraJobSpec> SpecOf(const CameraJob& job);

}  // namespace meshwright
