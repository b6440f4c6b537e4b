// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <absl/status/statusor.h>
#include <nlohmann/json.hpp>

#include "pipeline/options/reconstruction_options.h"

namespace meshwright {

// Options as users of REST and gRPC write them: a JSON object, {"window": 4}, any of them left out; {"preset": "draft"}
// chooses what those left out are. "" stands for {}.
// InvalidArgument begins with "options_json: ", then names the option, its value and the values allowed.
absl::StatusOr<ReconstructionOptions> ParseOptions(const std::string& options_json);

// {"method": 2, "max-image-size": 0, ...}: every option and the method's version. ParseOptions takes it.
nlohmann::ordered_json ToJson(const ReconstructionOptions& options);

// "--window was 3, now 1", one for each difference between two results of ToJson.
std::vector<std::string> DescribeDifferences(const nlohmann::ordered_json& before, const nlohmann::ordered_json& now);

// The words for a reconstruction that was begun with another version of the method.
std::string DescribeMethods(int64_t before, int64_t now);

// The answer of GET /v1/options: {"options": [...]}, each with name, group, type, unit, default, minimum, maximum,
// documentation and tradeOff, and {"presets": [...]}, each with name, documentation and values.
std::string DescribeOptionsForRest();

}  // namespace meshwright
