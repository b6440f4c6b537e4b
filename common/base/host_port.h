// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include <absl/status/statusor.h>

namespace meshwright {

struct HostPort {
  std::string host;  // a name or an address, IPv6 without brackets
  int port = 0;      // 0 .. 65535
};

// "HOST:PORT" or "[IPV6]:PORT". InvalidArgument calls the text by `name`: "--listen is \"7420\", expected host:port".
absl::StatusOr<HostPort> ParseHostPort(const std::string& text, const std::string& name);
// What ParseHostPort reads.
std::string ToString(const HostPort& address);

// Whether only this machine itself reaches `host`: "localhost", 127.x.y.z or ::1.
bool IsLoopbackHost(const std::string& host);

}  // namespace meshwright
