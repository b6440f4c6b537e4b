// SPDX-License-Identifier: Apache-2.0
#include "common/base/host_port.h"

#include <algorithm>

#include <absl/strings/ascii.h>
#include <absl/strings/match.h>
#include <absl/strings/numbers.h>
#include <absl/strings/str_cat.h>

namespace meshwright {

absl::StatusOr<HostPort> ParseHostPort(const std::string& text, const std::string& name) {
  const auto wrong = [&] {
    return absl::InvalidArgumentError(absl::StrCat(name, " is \"", text.substr(0, 64), "\", expected host:port"));
  };
  const size_t colon = text.rfind(':');
  if (colon == std::string::npos || colon == 0) return wrong();
  const std::string digits = text.substr(colon + 1);
  HostPort address;
  const bool is_number = !digits.empty() && std::ranges::all_of(digits, absl::ascii_isdigit);
  if (!is_number || !absl::SimpleAtoi(digits, &address.port) || address.port > 65535) return wrong();
  address.host = text.substr(0, colon);
  const bool in_brackets = address.host.front() == '[' && address.host.back() == ']';
  if (in_brackets) address.host = address.host.substr(1, address.host.size() - 2);
  const bool is_ipv6 = address.host.find(':') != std::string::npos;
  const bool has_blank = std::ranges::any_of(address.host, absl::ascii_isspace);
  if (address.host.empty() || has_blank || is_ipv6 != in_brackets) return wrong();
  return address;
}

bool IsLoopbackHost(const std::string& host) {
  // "127.example.org" is a name, and anybody's.
  const bool is_ipv4 = host.find_first_not_of("0123456789.") == std::string::npos;
  return absl::EqualsIgnoreCase(host, "localhost") || host == "::1" || (is_ipv4 && absl::StartsWith(host, "127."));
}

std::string ToString(const HostPort& address) {
  const bool is_ipv6 = address.host.find(':') != std::string::npos;
  return absl::StrCat(is_ipv6 ? "[" : "", address.host, is_ipv6 ? "]" : "", ":", address.port);
}

}  // namespace meshwright
