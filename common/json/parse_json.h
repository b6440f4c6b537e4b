// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <utility>

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <nlohmann/json.hpp>

#include "common/base/status_macros.h"
#include "common/json/json_limits.h"

namespace meshwright {

// The value of a JSON text (RFC 8259, UTF-8) that came from outside: from a user, a worker or a store. InvalidArgument,
// to be put behind the name of what the text is, where it is beyond the limits or no JSON. `Json` may be
// nlohmann::ordered_json where the order of members counts.
template <typename Json = nlohmann::json>
absl::StatusOr<Json> ParseJson(const std::string& text, const JsonLimits& limits = {}) {
  MW_RETURN_IF_ERROR(CheckJsonLimits(text, limits));
  Json json = Json::parse(text, nullptr, /*allow_exceptions=*/false);
  if (json.is_discarded()) return absl::InvalidArgumentError("is not valid JSON");
  return json;
}

}  // namespace meshwright
