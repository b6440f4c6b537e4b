// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <tuple>

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <absl/time/time.h>
#include <prometheus/counter.h>
#include <prometheus/gauge.h>
#include <prometheus/histogram.h>

#include "common/base/clock.h"
#include "common/base/mutex.h"
#include "common/telemetry/metrics.h"
#include "worker/agent/worker_channel.h"

namespace meshwright {

// The way to the coordinator, measured. All that a worker does passes here, so it is counted here too: jobs by how they
// ended, seconds of each stage, rays and patches, and what of the worker is in use. An outcome that is told several
// times counts once.
class MeasuredWorkerChannel final : public WorkerChannel {
 public:
  // All three outlive it.
  MeasuredWorkerChannel(WorkerChannel& channel, Metrics& metrics, const Clock& clock);

  absl::StatusOr<v1::SynchronizeResponse> Synchronize(const v1::SynchronizeRequest& request) override;
  void Interrupt() override { channel_.Interrupt(); }

  // OK while the coordinator answers; Unavailable says since when it does not. Thread-safe.
  absl::Status Ready() const;

 private:
  using Key = std::tuple<std::string, int32_t, int64_t>;  // reconstruction, sequence, epoch

  void CountOutcomes(const v1::SynchronizeRequest& request);
  void CountFinished(const v1::HeldJob::Finished& finished);
  void CountAnswer(const v1::SynchronizeRequest& request, const v1::SynchronizeResponse& response);
  prometheus::Counter& Jobs(const char* outcome);

  WorkerChannel& channel_;
  Metrics& metrics_;
  const Clock& clock_;
  CallMetrics calls_;
  prometheus::Gauge& cores_;
  prometheus::Gauge& memory_;
  prometheus::Gauge& running_;
  prometheus::Gauge& draining_;
  prometheus::Histogram& job_seconds_;

  // Of the thread that synchronizes.
  std::map<Key, absl::Time> begun_;
  std::set<Key> counted_;  // their outcome is counted, and they are told still

  mutable Mutex mutex_;
  std::optional<absl::Time> last_answer_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace meshwright
