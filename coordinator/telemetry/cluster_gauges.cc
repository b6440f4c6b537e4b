// SPDX-License-Identifier: Apache-2.0
#include "coordinator/telemetry/cluster_gauges.h"

#include <algorithm>
#include <filesystem>
#include <system_error>

#include <absl/time/time.h>

namespace meshwright {
namespace {

constexpr const char* kStates[] = {"created", "running", "done", "cancelled", "failed"};

struct WorkerSums {
  int64_t workers = 0;
  int64_t draining = 0;
  int64_t cores = 0;
  int64_t jobs = 0;
};

WorkerSums Sum(const v1::ListWorkersResponse& response) {
  WorkerSums sums;
  for (const v1::Worker& worker : response.workers()) {
    ++sums.workers;
    sums.draining += worker.draining() ? 1 : 0;
    sums.cores += worker.draining() ? 0 : worker.cores();
    sums.jobs += worker.jobs();
  }
  return sums;
}

void AddJobGauges(Metrics& metrics, SqlDatabase& database, const WorkerService& workers) {
  auto& waiting = metrics.Gauge("meshwright_jobs_waiting", "Camera jobs that no worker holds: the depth of the queue.");
  auto& leased = metrics.Gauge("meshwright_jobs_leased", "Camera jobs that workers hold.");
  auto& known = metrics.Gauge("meshwright_workers", "Workers that were heard of lately.");
  auto& draining = metrics.Gauge("meshwright_workers_draining", "Workers that take no new jobs.");
  auto& cores = metrics.Gauge("meshwright_workers_cores", "Cores of all workers that take jobs.");
  metrics.BeforeEachScrape([&waiting, &leased, &known, &draining, &cores, &database, &workers] {
    const WorkerSums sums = Sum(workers.ListWorkers());
    leased.Set(static_cast<double>(sums.jobs));
    known.Set(static_cast<double>(sums.workers));
    draining.Set(static_cast<double>(sums.draining));
    cores.Set(static_cast<double>(sums.cores));
    const absl::StatusOr<SqlResult> assigned = database.Run("count_assigned_camera_jobs", {});
    if (assigned.ok() && !assigned->rows.empty()) {
      waiting.Set(static_cast<double>(std::max<int64_t>(0, assigned->rows.front().Integer(0) - sums.jobs)));
    }
  });
}

void AddReconstructionGauges(Metrics& metrics, SqlDatabase& database) {
  const auto by_state = [&metrics](const char* state) -> prometheus::Gauge& {
    return metrics.Gauge("meshwright_reconstructions", "Reconstructions by state.", {{"state", state}});
  };
  for (const char* const state : kStates) by_state(state);
  auto& stalled =
      metrics.Gauge("meshwright_longest_without_commit_seconds",
                    "Of the running reconstructions, the longest time since the last commit; 0: none runs.");
  metrics.BeforeEachScrape([by_state, &stalled, &database] {
    if (const auto counts = database.Run("count_reconstructions", {}); counts.ok()) {
      for (const char* const state : kStates) {
        double count = 0;
        for (const SqlRow& row : counts->rows) {
          if (row.Text(0) == state) count = static_cast<double>(row.Integer(1));
        }
        by_state(state).Set(count);
      }
    }
    const auto oldest = database.Run("oldest_progress", {});
    const auto now = database.Now();
    if (!oldest.ok() || !now.ok() || oldest->rows.empty()) return;
    const bool none = oldest->rows.front().Text(0).empty();
    stalled.Set(none ? 0 : std::max(0.0, absl::ToDoubleSeconds(*now - oldest->rows.front().Time(0))));
  });
}

void AddDiskGauges(Metrics& metrics, const std::string& folder) {
  auto& size = metrics.Gauge("meshwright_data_disk_size_bytes", "Size of the file system that holds --data.");
  auto& free = metrics.Gauge("meshwright_data_disk_free_bytes", "What of it the coordinator can still write.");
  metrics.BeforeEachScrape([&size, &free, folder] {
    std::error_code error;
    const std::filesystem::space_info space = std::filesystem::space(folder, error);
    if (error) return;
    size.Set(static_cast<double>(space.capacity));
    free.Set(static_cast<double>(space.available));
  });
}

}  // namespace

void AddClusterGauges(Metrics& metrics, SqlDatabase& database, const WorkerService& workers,
                      const std::string& data_folder) {
  AddJobGauges(metrics, database, workers);
  AddReconstructionGauges(metrics, database);
  AddDiskGauges(metrics, data_folder);
}

}  // namespace meshwright
