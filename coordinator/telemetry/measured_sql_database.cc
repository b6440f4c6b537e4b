#include "coordinator/telemetry/measured_sql_database.h"

#include <algorithm>
#include <utility>

#include <absl/time/clock.h>

namespace meshwright {
namespace {

// What one changed row of a statement means.
struct CountedStatement {
  const char* statement;
  const char* metric;
  const char* help;
  const char* outcome;  // label; null: none
};
constexpr char kEnded[] = "meshwright_leases_ended_total";
constexpr char kEndedHelp[] = "Leases of camera jobs by how they ended; lost: the worker was silent for too long.";
constexpr CountedStatement kCountedStatements[] = {
    {"lease_camera_jobs", "meshwright_leases_granted_total", "Camera jobs handed out to workers.", nullptr},
    {"renew_lease", "meshwright_leases_renewed_total", "Leases prolonged because their worker was heard of.", nullptr},
    {"complete_camera_job", kEnded, kEndedHelp, "finished"},
    {"fail_lease", kEnded, kEndedHelp, "failed"},
    {"release_lease", kEnded, kEndedHelp, "given_back"},
    {"expire_lease", kEnded, kEndedHelp, "lost"},
    {"set_camera_job_aside", "meshwright_cameras_set_aside_total", "Cameras given up after repeated failures.",
     nullptr},
    {"add_commit", "meshwright_commits_total", "Cameras committed, in the order of their reconstructions.", nullptr},
};

constexpr char kAccepted[] = "meshwright_rays_accepted_total";
constexpr char kAcceptedHelp[] = "Rays whose patch other cameras confirmed: what became part of a mesh.";

prometheus::Labels LabelsOf(const CountedStatement& counted) {
  return counted.outcome == nullptr ? prometheus::Labels{} : prometheus::Labels{{"outcome", counted.outcome}};
}

}  // namespace

MeasuredSqlDatabase::MeasuredSqlDatabase(std::unique_ptr<SqlDatabase> database, Metrics& metrics)
    : database_(std::move(database)),
      metrics_(metrics),
      calls_(metrics, "meshwright_store", "Statements in the store") {
  for (const CountedStatement& counted : kCountedStatements) {
    metrics_.Counter(counted.metric, counted.help, LabelsOf(counted));
  }
  metrics_.Counter(kAccepted, kAcceptedHelp);
}

absl::StatusOr<SqlResult> MeasuredSqlDatabase::Run(const std::string& statement, const SqlParameters& parameters) {
  const absl::Time begun = absl::Now();
  absl::StatusOr<SqlResult> result = database_->Run(statement, parameters);
  calls_.Record(statement, absl::Now() - begun, result.status());
  if (result.ok()) {
    CountChanges(statement, parameters, static_cast<int64_t>(result->rows.size()), result->changed);
  }
  return result;
}

absl::StatusOr<bool> MeasuredSqlDatabase::RunTogether(const std::vector<SqlCall>& calls) {
  const absl::Time begun = absl::Now();
  absl::StatusOr<bool> changed = database_->RunTogether(calls);
  calls_.Record("transaction", absl::Now() - begun, changed.status());
  if (changed.ok() && *changed) {
    for (const SqlCall& call : calls) CountChanges(call.statement, call.parameters, 0, 1);
  }
  return changed;
}

void MeasuredSqlDatabase::CountChanges(const std::string& statement, const SqlParameters& parameters, int64_t rows,
                                       int64_t changed) {
  for (const CountedStatement& counted : kCountedStatements) {
    // Statements that give back what they changed tell it by their rows.
    const int64_t count = std::max(rows, changed);
    if (statement != counted.statement || count == 0) continue;
    metrics_.Counter(counted.metric, counted.help, LabelsOf(counted)).Increment(static_cast<double>(count));
  }
  if (statement != "add_commit" || changed == 0) return;
  for (const auto& [name, value] : parameters) {
    if (name != "accepted_patches") continue;
    metrics_.Counter(kAccepted, kAcceptedHelp).Increment(static_cast<double>(std::get<int64_t>(value)));
  }
}

}  // namespace meshwright
