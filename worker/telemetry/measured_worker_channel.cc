// SPDX-License-Identifier: Apache-2.0
#include "worker/telemetry/measured_worker_channel.h"

#include <utility>
#include <vector>

#include <absl/strings/str_cat.h>
#include <nlohmann/json.hpp>

#include "common/json/parse_json.h"

namespace meshwright {
namespace {

// The coordinator answers within its wait timeout of some ten seconds even when there is nothing to say.
constexpr absl::Duration kSilence = absl::Minutes(1);

const std::vector<double>& JobSecondsBounds() {
  static const std::vector<double> bounds = BucketBounds(0.01, 1000);
  return bounds;
}

// Counts of a job's report, by the name that they have in report.json too.
struct ReportedCount {
  const char* field;
  const char* metric;
  const char* help;
};
constexpr ReportedCount kReportedCounts[] = {
    {"rays", "meshwright_rays_total", "Lattice rays of the cameras that were processed."},
    {"rays_covered_before", "meshwright_rays_covered_before_total", "Rays that surfaces accepted before did cover."},
    {"rays_grown", "meshwright_rays_grown_total", "Rays on which at least one patch grew."},
    {"rays_filtered", "meshwright_rays_filtered_total", "Rays that kept a patch after filtering."},
    {"seeds", "meshwright_seeds_total", "Seeds."},
    {"patches_grown", "meshwright_patches_grown_total", "Patches that grew."},
    {"tentative_patches_scored", "meshwright_tentative_patches_scored_total",
     "Patches whose photo-consistency was computed."},
};

auto KeyOf(const v1::JobKey& key) { return std::tuple(key.reconstruction_id(), key.sequence(), key.epoch()); }

}  // namespace

MeasuredWorkerChannel::MeasuredWorkerChannel(WorkerChannel& channel, Metrics& metrics, const Clock& clock)
    : channel_(channel),
      metrics_(metrics),
      clock_(clock),
      calls_(metrics, "meshwright_coordinator_call",
             "Calls of the worker to its coordinator, waiting for jobs included"),
      cores_(metrics.Gauge("meshwright_worker_cores", "Cores that jobs may use; jobs that may run at the same time.")),
      memory_(metrics.Gauge("meshwright_worker_memory_limit_bytes", "Memory that jobs may take together.")),
      running_(metrics.Gauge("meshwright_worker_jobs_running", "Camera jobs that run.")),
      draining_(metrics.Gauge("meshwright_worker_draining", "1 when no new jobs are taken.")),
      job_seconds_(metrics.Histogram("meshwright_camera_job_seconds", "Camera jobs that were finished, all stages.",
                                     JobSecondsBounds())) {
  for (const char* const outcome : {"finished", "failed", "failed_infrastructure", "released", "lost"}) Jobs(outcome);
  for (const ReportedCount& count : kReportedCounts) metrics_.Counter(count.metric, count.help);
}

absl::StatusOr<v1::SynchronizeResponse> MeasuredWorkerChannel::Synchronize(const v1::SynchronizeRequest& request) {
  CountOutcomes(request);
  const absl::Time begun = clock_.Now();
  absl::StatusOr<v1::SynchronizeResponse> response = channel_.Synchronize(request);
  const absl::Time now = clock_.Now();
  // Cancelled: the worker itself had something to say.
  calls_.Record("synchronize", now - begun,
                absl::IsCancelled(response.status()) ? absl::OkStatus() : response.status());
  if (!response.ok()) return response;
  {
    const MutexLock lock(mutex_);
    last_answer_ = now;
  }
  CountAnswer(request, *response);
  return response;
}

absl::Status MeasuredWorkerChannel::Ready() const {
  const MutexLock lock(mutex_);
  if (!last_answer_.has_value()) return absl::UnavailableError("the coordinator has not answered yet");
  const absl::Duration silence = clock_.Now() - *last_answer_;
  if (silence <= kSilence) return absl::OkStatus();
  return absl::UnavailableError(
      absl::StrCat("the coordinator has not answered for ", absl::ToInt64Seconds(silence), " s"));
}

prometheus::Counter& MeasuredWorkerChannel::Jobs(const char* outcome) {
  return metrics_.Counter("meshwright_camera_jobs_total",
                          "Camera jobs of this worker by how they ended; lost: somebody else has them.",
                          {{"outcome", outcome}});
}

void MeasuredWorkerChannel::CountOutcomes(const v1::SynchronizeRequest& request) {
  cores_.Set(request.cores());
  memory_.Set(static_cast<double>(request.memory_bytes()));
  draining_.Set(request.draining() ? 1 : 0);
  int running = 0;
  std::set<Key> told;
  for (const v1::HeldJob& held : request.held()) {
    if (held.has_running()) {
      ++running;
      continue;
    }
    const Key key = KeyOf(held.key());
    told.insert(key);
    if (!counted_.insert(key).second) continue;
    if (held.has_finished()) {
      Jobs("finished").Increment();
      if (const auto begun = begun_.find(key); begun != begun_.end()) {
        job_seconds_.Observe(absl::ToDoubleSeconds(clock_.Now() - begun->second));
      }
      CountFinished(held.finished());
    } else if (held.has_failed()) {
      Jobs(held.failed().infrastructure() ? "failed_infrastructure" : "failed").Increment();
    } else if (held.has_released()) {
      Jobs("released").Increment();
    }
  }
  std::erase_if(counted_, [&](const Key& key) { return told.count(key) == 0; });
  running_.Set(running);
}

void MeasuredWorkerChannel::CountFinished(const v1::HeldJob::Finished& finished) {
  const absl::StatusOr<nlohmann::json> parsed = ParseJson(finished.report_json());
  if (!parsed.ok() || !parsed->is_object()) return;
  const nlohmann::json& report = *parsed;
  for (const ReportedCount& count : kReportedCounts) {
    if (const auto field = report.find(count.field); field != report.end() && field->is_number()) {
      metrics_.Counter(count.metric, count.help).Increment(field->get<double>());
    }
  }
  const auto stages = report.find("seconds");
  if (stages == report.end() || !stages->is_object()) return;
  for (const auto& [stage, seconds] : stages->items()) {
    if (!seconds.is_number()) continue;
    metrics_
        .Histogram("meshwright_camera_job_stage_seconds", "Wall time of each stage of a camera job.",
                   JobSecondsBounds(), {{"stage", stage}})
        .Observe(seconds.get<double>());
  }
}

void MeasuredWorkerChannel::CountAnswer(const v1::SynchronizeRequest& request,
                                        const v1::SynchronizeResponse& response) {
  std::map<Key, absl::Time> held;
  for (const v1::CameraJob& job : response.jobs()) {
    const Key key = KeyOf(job.key());
    const auto known = begun_.find(key);
    held[key] = known != begun_.end() ? known->second : clock_.Now();
  }
  int ended = 0;
  for (const v1::HeldJob& told : request.held()) {
    const bool wanted = held.count(KeyOf(told.key())) > 0;
    if (told.has_running() && !wanted) Jobs("lost").Increment();
    if (!told.has_running() && wanted) ++ended;
  }
  begun_ = std::move(held);
  running_.Set(static_cast<double>(begun_.size()) - ended);
}

}  // namespace meshwright
