// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include <absl/status/status.h>
#include <google/protobuf/message.h>
#include <nlohmann/json.hpp>

namespace meshwright {

// Protobuf's own mapping: camelCase, 64-bit integers as strings, enumerations by name; default values are written too.
std::string ToJson(const google::protobuf::Message& message);
// The other way. InvalidArgument names the field; unknown ones are refused.
absl::Status FromJson(const std::string& json, google::protobuf::Message& message);

// Text for the wire whatever bytes strings have.
std::string Dump(const nlohmann::ordered_json& json);

}  // namespace meshwright
