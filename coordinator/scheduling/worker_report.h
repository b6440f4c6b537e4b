// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <variant>
#include <vector>

#include "common/base/ids.h"
#include "coordinator/store/job_store.h"

namespace meshwright {

// Names one handing-out of one camera job.
struct JobKey {
  std::string reconstruction;
  SequenceNumber sequence = 0;
  int64_t epoch = 0;

  auto operator<=>(const JobKey&) const = default;
};
inline JobKey KeyOf(const OpenJob& job) { return {job.reconstruction_id, job.sequence, job.epoch}; }

// What has become of a job that a worker holds.
struct JobRunning {
  // Of estimating cameras: what it is at, and how much of everything is done.
  std::string step;
  double fraction = 0;
};
struct JobFinished {
  std::string filtered_digest;  // F_r, durable in the BlobStore
  std::vector<CameraIndex> weak_targets;
  std::string report_json;
};
struct JobFailed {
  std::string reason;
  bool out_of_memory = false;
  bool infrastructure = false;  // says nothing about the job
  std::string damaged_blob;     // "" unless it could not read this one
  bool permanent = false;       // another attempt would meet the same
};
struct JobReleased {};

struct HeldJob {
  JobKey key;
  std::variant<JobRunning, JobFinished, JobFailed, JobReleased> outcome;
};

// What a worker says of itself and of the jobs that it holds: a process in a cluster, or the threads of this one.
struct WorkerReport {
  std::string worker;
  std::string instance;        // of its process
  int64_t method_version = 0;  // it does jobs of reconstructions that were begun with the same
  int cores = 1;               // it takes as many jobs
  int64_t memory_bytes = 0;
  bool draining = false;           // it wants nothing more
  bool ran_out_of_memory = false;  // the process before it did
  bool has_colmap = false;         // it can estimate cameras
  std::vector<HeldJob> held;
};

}  // namespace meshwright
