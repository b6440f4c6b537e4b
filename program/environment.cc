// SPDX-License-Identifier: Apache-2.0
#include "program/environment.h"

#include <algorithm>
#include <cstdlib>
#include <regex>

#include <absl/strings/ascii.h>
#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_replace.h>
#include <unistd.h>

#include "common/base/nearest_name.h"

namespace meshwright {
namespace {

constexpr char kPrefix[] = "MESHWRIGHT_";

// Settings of all programs of Meshwright: machines often have one environment for several of them. Then what the
// compose file and the tests read. A test holds that no program has a setting that is not here.
const std::vector<std::string>& KnownNames() {
  static const auto* const names = new std::vector<std::string>{
      // meshwright, meshwright-coordinator, meshwright-worker
      "api-token-file", "blobs", "ca-file", "client-ca-file", "client-cert", "client-key", "config", "coordinator",
      "coordinator-threads", "cores", "dashboard", "data", "drain-seconds", "exit-when-idle", "grpc-reflection",
      "insecure", "job-time-limit-seconds", "lease-seconds", "listen", "memory", "metrics-listen", "nodeodm-listen",
      "nodeodm-max-images", "rest-listen", "rest-tls-cert", "rest-tls-key", "trusted-proxy", "scene-root", "store",
      "tls-cert", "tls-key", "token-file", "user-gigabytes", "user-reconstructions", "user-requests-per-second",
      "webhook-secret-file", "webhook-url", "worker-id", "worker-token-file",
      // docker-compose.yml
      "grafana-password", "grafana-port", "keys", "port", "postgres-password", "prometheus-port", "rest-port", "scenes",
      "worker-cores", "workers",
      // tests
      "postgres-bin", "test-data", "test-postgres"};
  return *names;
}

bool IsOfServiceDiscovery(const std::string& variable) {
  static const auto* const pattern = new std::regex(
      "MESHWRIGHT_[A-Z0-9_]+_(SERVICE_HOST|SERVICE_PORT(_[A-Z0-9_]+)?|PORT|PORT_[0-9]+_(TCP|UDP)(_[A-Z]+)?)");
  return std::regex_match(variable, *pattern);
}

std::vector<std::string> VariablesOf(const std::vector<std::string>& settings) {
  std::vector<std::string> variables;
  for (const std::string& setting : settings) variables.push_back(EnvironmentNameOf(setting));
  return variables;
}

}  // namespace

std::string EnvironmentNameOf(const std::string& setting) {
  return kPrefix + absl::AsciiStrToUpper(absl::StrReplaceAll(setting, {{"-", "_"}}));
}

absl::StatusOr<std::vector<Setting>> SettingsOfEnvironment(const std::vector<std::string>& names) {
  const std::vector<std::string> own = VariablesOf(names);
  std::vector<std::string> known = VariablesOf(KnownNames());
  known.insert(known.end(), own.begin(), own.end());
  for (char** entry = environ; entry != nullptr && *entry != nullptr; ++entry) {
    const std::string text = *entry;
    const std::string variable = text.substr(0, text.find('='));
    if (!absl::StartsWith(variable, kPrefix) || std::ranges::count(known, variable) > 0) continue;
    if (IsOfServiceDiscovery(variable)) continue;
    return absl::InvalidArgumentError(
        absl::StrCat("environment: there is no setting ", variable.substr(0, 64), DidYouMean(variable, known)));
  }
  std::vector<Setting> settings;
  for (size_t i = 0; i < names.size(); ++i) {
    const char* const value = std::getenv(own[i].c_str());
    if (value == nullptr || *value == '\0') continue;
    settings.push_back({.name = names[i], .value = value, .source = own[i]});
  }
  return settings;
}

}  // namespace meshwright
