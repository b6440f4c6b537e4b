// SPDX-License-Identifier: Apache-2.0
#include "coordinator/telemetry/measured_sql_database.h"

#include <algorithm>
#include <utility>

namespace meshwright {
namespace {

// What one changed row of a statement means.
struct CountedStatement {
  const char* statement;
  const char* metric;  // null: not counted
  const char* help;
  const char* outcome;  // label; null: none
  const char* event;    // null: not logged
  bool bad_news;
};
constexpr char kEnded[] = "meshwright_leases_ended_total";
constexpr char kEndedHelp[] = "Leases of camera jobs by how they ended; lost: the worker was silent for too long.";
constexpr CountedStatement kCountedStatements[] = {
    {"create_reconstruction", nullptr, nullptr, nullptr, "reconstruction created", false},
    {"request_reconstruction_state", nullptr, nullptr, nullptr, "reconstruction state", false},
    {"set_reconstruction_state", nullptr, nullptr, nullptr, "reconstruction state", false},
    {"finish_reconstruction", nullptr, nullptr, nullptr, "reconstruction done", false},
    {"reopen_camera_job", nullptr, nullptr, nullptr, "result taken back", true},
    {"delete_reconstruction", nullptr, nullptr, nullptr, "reconstruction deleted", false},
    {"claim_camera_job", "meshwright_leases_granted_total", "Camera jobs handed out to workers.", nullptr, "job leased",
     false},
    {"renew_lease", "meshwright_leases_renewed_total", "Leases prolonged because their worker was heard of.", nullptr,
     nullptr, false},
    {"complete_camera_job", kEnded, kEndedHelp, "finished", "job finished", false},
    {"fail_lease", kEnded, kEndedHelp, "failed", "job failed", true},
    {"release_lease", kEnded, kEndedHelp, "released", "job released", false},
    {"expire_lease", kEnded, kEndedHelp, "lost", "lease lost", true},
    {"set_camera_job_aside", "meshwright_cameras_skipped_total", "Cameras given up after repeated failures.", nullptr,
     "camera skipped", true},
    {"add_commit", "meshwright_commits_total", "Cameras committed, in the order of their reconstructions.", nullptr,
     "camera committed", false},
    {"acquire_conductor_lease", nullptr, nullptr, nullptr, "conducting", false},
};

// Parameters that a line of the log shows, by the names of its fields.
constexpr std::pair<const char*, const char*> kLoggedParameters[] = {
    {"id", "reconstruction"}, {"sequence", "sequence"}, {"epoch", "attempt"}, {"camera", "camera"},
    {"worker", "worker"},     {"owner", "coordinator"}, {"state", "state"},   {"accepted_patches", "accepted_patches"},
    {"reason", "error"},
};

LogFields FieldsOf(const SqlParameters& parameters) {
  LogFields fields;
  for (const auto& [name, field] : kLoggedParameters) {
    for (const auto& [parameter, value] : parameters) {
      if (parameter != name) continue;
      if (const auto* const number = std::get_if<int64_t>(&value)) fields.emplace_back(field, *number);
      const auto* const text = std::get_if<std::string>(&value);
      if (text != nullptr && !text->empty()) fields.emplace_back(field, *text);
    }
  }
  return fields;
}

constexpr char kAccepted[] = "meshwright_rays_accepted_total";
constexpr char kAcceptedHelp[] = "Rays whose patch other cameras confirmed: what became part of a mesh.";

prometheus::Labels LabelsOf(const CountedStatement& counted) {
  return counted.outcome == nullptr ? prometheus::Labels{} : prometheus::Labels{{"outcome", counted.outcome}};
}

}  // namespace

MeasuredSqlDatabase::MeasuredSqlDatabase(std::unique_ptr<SqlDatabase> database, Metrics& metrics, Logger log)
    : database_(std::move(database)),
      metrics_(metrics),
      calls_(metrics, "meshwright_store", "Statements in the store"),
      log_(std::move(log)) {
  for (const CountedStatement& counted : kCountedStatements) {
    if (counted.metric != nullptr) metrics_.Counter(counted.metric, counted.help, LabelsOf(counted));
  }
  metrics_.Counter(kAccepted, kAcceptedHelp);
}

absl::StatusOr<SqlResult> MeasuredSqlDatabase::Run(const std::string& statement, const SqlParameters& parameters) {
  const Stopwatch stopwatch;
  absl::StatusOr<SqlResult> result = database_->Run(statement, parameters);
  Record(statement, stopwatch, result.status());
  if (result.ok()) {
    CountChanges(statement, parameters, static_cast<int64_t>(result->rows.size()), result->changed);
  }
  return result;
}

absl::StatusOr<bool> MeasuredSqlDatabase::RunTogether(const std::vector<SqlCall>& calls) {
  const Stopwatch stopwatch;
  absl::StatusOr<bool> changed = database_->RunTogether(calls);
  Record("transaction", stopwatch, changed.status());
  if (changed.ok() && *changed) {
    for (const SqlCall& call : calls) CountChanges(call.statement, call.parameters, 0, 1);
  }
  return changed;
}

absl::StatusOr<std::vector<SqlResult>> MeasuredSqlDatabase::RunAll(const std::vector<SqlCall>& calls) {
  const Stopwatch stopwatch;
  absl::StatusOr<std::vector<SqlResult>> results = database_->RunAll(calls);
  Record("transaction", stopwatch, results.status());
  if (!results.ok()) return results;
  for (size_t i = 0; i < calls.size(); ++i) {
    const SqlResult& result = (*results)[i];
    CountChanges(calls[i].statement, calls[i].parameters, static_cast<int64_t>(result.rows.size()), result.changed);
  }
  return results;
}

void MeasuredSqlDatabase::Record(const std::string& operation, const Stopwatch& stopwatch, const absl::Status& status) {
  calls_.Record(operation, stopwatch.Elapsed(), status);
  if (!status.ok()) {
    log_.Error("store failed", {{"operation", operation}, {"error", std::string(status.message())}});
  }
}

void MeasuredSqlDatabase::CountChanges(const std::string& statement, const SqlParameters& parameters, int64_t rows,
                                       int64_t changed) {
  // Statements that give back what they changed tell it by their rows.
  const int64_t count = std::max(rows, changed);
  if (count == 0) return;
  for (const CountedStatement& counted : kCountedStatements) {
    if (statement != counted.statement) continue;
    if (counted.metric != nullptr) {
      metrics_.Counter(counted.metric, counted.help, LabelsOf(counted)).Increment(static_cast<double>(count));
    }
    if (counted.event == nullptr) continue;
    if (counted.bad_news) {
      log_.Warning(counted.event, FieldsOf(parameters));
    } else {
      log_.Info(counted.event, FieldsOf(parameters));
    }
  }
  if (statement != "add_commit") return;
  for (const auto& [name, value] : parameters) {
    if (name != "accepted_patches") continue;
    metrics_.Counter(kAccepted, kAcceptedHelp).Increment(static_cast<double>(std::get<int64_t>(value)));
  }
}

}  // namespace meshwright
