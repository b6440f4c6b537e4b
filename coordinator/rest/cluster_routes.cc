// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <utility>

#include <absl/strings/str_cat.h>

#include "common/base/status_macros.h"
#include "coordinator/rest/json.h"
#include "coordinator/rest/routes.h"

namespace meshwright {

// Made from openapi.yaml at build time.
const std::vector<std::pair<std::string, std::string>>& RestDescriptions();

namespace {

constexpr char kText[] = "text/plain; charset=utf-8";

absl::Status Say(RestCall& call, const std::string& text, const char* type) {
  call.response.SetContent(text, type);
  return absl::OkStatus();
}

// A key that a browser showed once comes back as a cookie that no script can read.
absl::Status SetSession(RestCall& call, const std::string& key) {
  const bool secure = call.request.is_tls || call.request.headers.Get("X-Forwarded-Proto") == "https";
  call.response.headers.Set("Set-Cookie", absl::StrCat("meshwright-token=", key, "; HttpOnly; SameSite=Strict; Path=/",
                                                       key.empty() ? "; Max-Age=0" : "", secure ? "; Secure" : ""));
  call.response.status = 204;
  return absl::OkStatus();
}

}  // namespace

void AddClusterRoutes(const RestContext& context, std::vector<Route>& routes) {
  const auto add = [&](const char* method, const char* path, RestHandler handler) {
    routes.push_back({method, path, {}, std::move(handler)});
  };
  add("GET", "/v1/workers",
      [&context](RestCall& call) { return Say(call, ToJson(context.workers->ListWorkers()), kJsonType); });
  add("POST", "/v1/workers/{worker}:drain", [&context](RestCall& call) -> absl::Status {
    MW_RETURN_IF_ERROR(context.workers->Drain(call.path.at("worker")));
    call.response.status = 204;
    return absl::OkStatus();
  });
  add("POST", "/v1/session", [&context](RestCall& call) {
    // It was found to be valid; where none is asked for, none is kept.
    const std::string header = context.gate->is_open() ? "" : call.request.headers.Get("Authorization");
    return SetSession(call, header.substr(std::min(header.size(), sizeof("Bearer ") - 1)));
  });
  add("DELETE", "/v1/session", [](RestCall& call) { return SetSession(call, ""); });
  add("GET", "/v1/options", [&context](RestCall& call) { return Say(call, context.options_json, kJsonType); });
  add("GET", "/v1/openapi.yaml",
      [](RestCall& call) { return Say(call, RestDescriptions().front().second, "application/yaml"); });
  add("GET", "/healthz", [](RestCall& call) { return Say(call, "ok\n", kText); });
  add("GET", "/readyz", [&context](RestCall& call) -> absl::Status {
    if (const absl::Status ready = context.ready(); !ready.ok()) {
      return absl::UnavailableError(absl::StrCat("not ready: ", std::string(ready.message())));
    }
    return Say(call, "ok\n", kText);
  });
}

std::vector<Route> MakeRoutes(const RestContext& context) {
  std::vector<Route> routes;
  AddReconstructionRoutes(context, routes);
  AddSceneRoutes(context, routes);
  AddResultRoutes(context, routes);
  AddClusterRoutes(context, routes);
  return routes;
}

}  // namespace meshwright
