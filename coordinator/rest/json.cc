#include "coordinator/rest/json.h"

#include <memory>

#include <absl/strings/str_cat.h>
#include <google/protobuf/descriptor.h>
#include <google/protobuf/util/json_util.h>

#include "common/base/check.h"
#include "common/json/parse_json.h"
#include "coordinator/rest/problem.h"

namespace meshwright {
namespace {

constexpr size_t kMaxJsonBytes = size_t{1} << 20;

}  // namespace

std::string ToJson(const google::protobuf::Message& message) {
  google::protobuf::util::JsonPrintOptions options;
  options.always_print_primitive_fields = true;
  std::string json;
  MW_CHECK(google::protobuf::util::MessageToJsonString(message, &json, options).ok());
  return json;
}

absl::Status FromJson(const std::string& json, google::protobuf::Message& message) {
  const absl::StatusOr<nlohmann::json> object = ParseJson(json, {.max_bytes = kMaxJsonBytes});
  if (!object.ok()) {
    return absl::InvalidArgumentError(absl::StrCat("the body ", std::string(object.status().message())));
  }
  if (!object->is_object()) return absl::InvalidArgumentError("the body is not a JSON object");
  // One field after the other, so that the field to blame has a name.
  for (const auto& [name, value] : object->items()) {
    const google::protobuf::FieldDescriptor* field = message.GetDescriptor()->FindFieldByCamelcaseName(name);
    if (field == nullptr) {
      return FieldError(name.substr(0, 64),
                        absl::InvalidArgumentError(absl::StrCat("there is no field \"", name.substr(0, 64), "\"")));
    }
    // No message of the interface has a field that is an array or an object.
    nlohmann::json single = nlohmann::json::object();
    if (!value.is_structured()) single[name] = value;
    const std::unique_ptr<google::protobuf::Message> parsed(message.New());
    const bool taken = !single.empty() && google::protobuf::util::JsonStringToMessage(single.dump(), parsed.get()).ok();
    if (!taken) {
      const std::string said = value.is_structured() ? value.type_name() : value.dump().substr(0, 64);
      return FieldError(
          name, absl::InvalidArgumentError(absl::StrCat(name, " is ", said, ", expected a ", field->cpp_type_name())));
    }
    message.MergeFrom(*parsed);
  }
  return absl::OkStatus();
}

std::string Dump(const nlohmann::ordered_json& json) {
  return json.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
}

}  // namespace meshwright
// SPDX-License-Identifier: Apache-2.0
