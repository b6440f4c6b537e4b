// SPDX-License-Identifier: Apache-2.0
#include "common/http_server/foreign_requests.h"

#include <absl/strings/ascii.h>
#include <absl/strings/match.h>

#include "common/base/host_port.h"

namespace meshwright {

bool OnlyReads(const HttpRequest& request) { return request.method == "GET" || request.method == "HEAD"; }

bool IsForeign(const HttpRequest& request) {
  if (OnlyReads(request)) return false;
  const std::string origin = request.headers.Get("Origin");
  const size_t host = origin.find("://");
  return !origin.empty() && (host == std::string::npos || origin.substr(host + 3) != request.headers.Get("Host"));
}

bool IsRebound(const HttpRequest& request, const std::string& listen, const std::set<std::string>& trusted_proxies) {
  const absl::StatusOr<HostPort> address = ParseHostPort(listen, "listen");
  if (!trusted_proxies.empty() || !address.ok() || !IsLoopbackHost(address->host)) return false;
  const std::string host = request.headers.Get("Host");
  const std::string name = absl::AsciiStrToLower(host.substr(0, host.find(':')));
  const bool is_address = host.find_first_not_of("0123456789.:") == std::string::npos || absl::StartsWith(host, "[");
  return !is_address && absl::StrContains(name, '.') && !absl::EndsWith(name, ".localhost");
}

}  // namespace meshwright
