// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>
#include <vector>

#include <absl/status/statusor.h>
#include <absl/time/time.h>

#include "common/base/clock.h"
#include "common/telemetry/log.h"
#include "common/telemetry/metrics.h"
#include "coordinator/store/sql_database.h"

namespace meshwright {

// Another SqlDatabase, measured: meshwright_store_seconds{operation}, meshwright_store_errors_total{operation, code},
// and what the statements that changed something mean: leases by how they began and ended, cameras, commits. The log
// gets a line for each such event but prolonged leases, and for each statement that failed.
class MeasuredSqlDatabase final : public SqlDatabase {
 public:
  // `metrics` outlives it.
  MeasuredSqlDatabase(std::unique_ptr<SqlDatabase> database, Metrics& metrics, Logger log);

  absl::StatusOr<SqlResult> Run(const std::string& statement, const SqlParameters& parameters) override;
  absl::StatusOr<bool> RunTogether(const std::vector<SqlCall>& calls) override;
  absl::StatusOr<std::vector<SqlResult>> RunAll(const std::vector<SqlCall>& calls) override;
  absl::StatusOr<absl::Time> Now() override { return database_->Now(); }

 private:
  void Record(const std::string& operation, const Stopwatch& stopwatch, const absl::Status& status);
  void CountChanges(const std::string& statement, const SqlParameters& parameters, int64_t rows, int64_t changed);

  const std::unique_ptr<SqlDatabase> database_;
  Metrics& metrics_;
  CallMetrics calls_;
  const Logger log_;
};

}  // namespace meshwright
