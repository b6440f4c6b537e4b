// SPDX-License-Identifier: Apache-2.0
#include "coordinator/dispatch/report_from_proto.h"

#include <utility>

namespace meshwright {
namespace {

HeldJob HeldJobFromProto(const v1::HeldJob& held) {
  HeldJob job = {.key = FromProto(held.key())};
  switch (held.outcome_case()) {
    case v1::HeldJob::kFinished:
      job.outcome =
          JobFinished{.filtered_digest = held.finished().filtered_digest(),
                      .weak_targets = {held.finished().weak_targets().begin(), held.finished().weak_targets().end()},
                      .report_json = held.finished().report_json()};
      break;
    case v1::HeldJob::kFailed:
      job.outcome = JobFailed{.reason = held.failed().reason(),
                              .out_of_memory = held.failed().out_of_memory(),
                              .infrastructure = held.failed().infrastructure(),
                              .damaged_blob = held.failed().damaged_blob(),
                              .permanent = held.failed().permanent()};
      break;
    case v1::HeldJob::kReleased:
      job.outcome = JobReleased();
      break;
    case v1::HeldJob::kRunning:
      job.outcome = JobRunning{.step = held.running().step(), .fraction = held.running().fraction()};
      break;
    case v1::HeldJob::OUTCOME_NOT_SET:
      break;
  }
  return job;
}

}  // namespace

JobKey FromProto(const v1::JobKey& key) { return {key.reconstruction_id(), key.sequence(), key.epoch()}; }

WorkerReport FromProto(const v1::SynchronizeRequest& request) {
  WorkerReport report = {.worker = request.worker_id(),
                         .instance = request.instance(),
                         .method_version = request.method_version(),
                         .cores = request.cores(),
                         .memory_bytes = request.memory_bytes(),
                         .draining = request.draining(),
                         .ran_out_of_memory = request.ran_out_of_memory(),
                         .has_colmap = !request.colmap_version().empty()};
  for (const v1::HeldJob& held : request.held()) report.held.push_back(HeldJobFromProto(held));
  return report;
}

}  // namespace meshwright
