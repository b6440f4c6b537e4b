// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

namespace meshwright {

// A message without where things are on this server: of every absolute path and address only the last part stays.
// "/var/lib/meshwright/blobs/ab/abcd: cannot open" -> "abcd: cannot open". Paths of the interface, "/v1/...", stay.
std::string WithoutServerPaths(const std::string& text);

}  // namespace meshwright
