// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "common/telemetry/metrics.h"
#include "coordinator/dispatch/worker_service.h"
#include "coordinator/store/sql_database.h"

namespace meshwright {

// What the whole cluster looks like at the moment of a scrape: jobs that wait (the queue depth) and that workers hold,
// reconstructions by state, the longest time without a commit, workers with their cores; and the disk below
// `data_folder`. Several coordinators of one store all say the same: take the largest, not the sum. What cannot be
// asked for keeps its last value. All of it outlives the last scrape.
void AddClusterGauges(Metrics& metrics, SqlDatabase& database, const WorkerService& workers,
                      const std::string& data_folder);

}  // namespace meshwright
