// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

namespace meshwright {

// A JSON value (nlohmann::json, nlohmann::ordered_json) as text. Values may come from outside (names of files are
// bytes), and JSON must be UTF-8: what is not becomes U+FFFD, where `dump` alone would throw. `indent`: -1 for one
// line.
template <typename Json>
std::string JsonText(const Json& json, int indent = -1) {
  return json.dump(indent, ' ', false, Json::error_handler_t::replace);
}

}  // namespace meshwright
