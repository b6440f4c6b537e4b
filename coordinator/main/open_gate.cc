// SPDX-License-Identifier: Apache-2.0
#include "coordinator/main/open_gate.h"

#include <string>

#include "common/base/digest.h"
#include "common/base/status_macros.h"
#include "common/base/token_file.h"

namespace meshwright {
namespace {

constexpr int64_t kGigabyte = 1'000'000'000;

void Tell(const Logger& log, const AuditEvent& event) {
  LogFields fields = {{"user", event.caller.user},
                      {"key", event.caller.token_id},
                      {"address", event.caller.address},
                      {"call", event.deed}};
  if (!event.reconstruction.empty()) fields.emplace_back("reconstruction", event.reconstruction.substr(0, 64));
  fields.emplace_back("outcome", absl::StatusCodeToString(event.outcome.code()));
  log.Info("audit", fields);
}

std::string DigestOf(const std::string& key) { return key.empty() ? "" : Sha256Hex(key); }

}  // namespace

absl::StatusOr<std::unique_ptr<Gatekeeper>> OpenGate(const CoordinatorSettings& settings, JobStore& store,
                                                     const Clock& clock, const Logger& log, Metrics& metrics) {
  MW_ASSIGN_OR_RETURN(const std::string operator_key, ReadTokenFile(settings.api_token_file, "--api-token-file"));
  MW_ASSIGN_OR_RETURN(const std::string worker_key, ReadTokenFile(settings.worker_token_file, "--worker-token-file"));
  GatekeeperOptions options = {.operator_key_digest = DigestOf(operator_key),
                               .worker_key_digest = DigestOf(worker_key),
                               .quotas = {.reconstructions = settings.user_reconstructions,
                                          .scene_bytes = settings.user_gigabytes * kGigabyte,
                                          .requests_per_second = settings.user_requests_per_second}};
  options.audit = [&log](const AuditEvent& event) { Tell(log, event); };
  options.count_refusal = [&metrics](const absl::Status& status) {
    metrics
        .Counter("meshwright_calls_refused_total", "Calls over HTTP and gRPC that were refused for who made them.",
                 {{"code", absl::StatusCodeToString(status.code())}})
        .Increment();
  };
  return std::make_unique<Gatekeeper>(std::move(options), store, clock);
}

}  // namespace meshwright
