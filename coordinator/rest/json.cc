// SPDX-License-Identifier: Apache-2.0
#include "coordinator/rest/json.h"

#include <memory>
#include <vector>

#include <absl/strings/str_cat.h>
#include <google/protobuf/descriptor.h>
#include <google/protobuf/util/json_util.h>

#include "common/base/check.h"
#include "common/base/utf8.h"
#include "common/json/json_text.h"
#include "common/json/parse_json.h"
#include "coordinator/rest/problem.h"

namespace meshwright {
namespace {

constexpr size_t kMaxJsonBytes = size_t{1} << 20;

// What is in the store may be of a version that put bytes there which are no text.
void MakeUtf8(google::protobuf::Message& message) {
  const google::protobuf::Reflection& reflection = *message.GetReflection();
  std::vector<const google::protobuf::FieldDescriptor*> fields;
  reflection.ListFields(message, &fields);
  for (const google::protobuf::FieldDescriptor* field : fields) {
    const bool is_text = field->type() == google::protobuf::FieldDescriptor::TYPE_STRING;
    const bool is_message = field->cpp_type() == google::protobuf::FieldDescriptor::CPPTYPE_MESSAGE;
    for (int i = 0; field->is_repeated() && i < reflection.FieldSize(message, field); ++i) {
      if (is_message) MakeUtf8(*reflection.MutableRepeatedMessage(&message, field, i));
      if (is_text) {
        reflection.SetRepeatedString(&message, field, i, ToUtf8(reflection.GetRepeatedString(message, field, i)));
      }
    }
    if (field->is_repeated()) continue;
    if (is_message) MakeUtf8(*reflection.MutableMessage(&message, field));
    if (is_text) reflection.SetString(&message, field, ToUtf8(reflection.GetString(message, field)));
  }
}

}  // namespace

std::string ToJson(const google::protobuf::Message& message) {
  google::protobuf::util::JsonPrintOptions options;
  options.always_print_primitive_fields = true;
  std::string json;
  if (google::protobuf::util::MessageToJsonString(message, &json, options).ok()) return json;
  json.clear();
  const std::unique_ptr<google::protobuf::Message> text(message.New());
  text->CopyFrom(message);
  MakeUtf8(*text);
  MW_CHECK(google::protobuf::util::MessageToJsonString(*text, &json, options).ok());
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
    const bool taken =
        !single.empty() && google::protobuf::util::JsonStringToMessage(JsonText(single), parsed.get()).ok();
    if (!taken) {
      const std::string said = value.is_structured() ? value.type_name() : JsonText(value).substr(0, 64);
      return FieldError(
          name, absl::InvalidArgumentError(absl::StrCat(name, " is ", said, ", expected a ", field->cpp_type_name())));
    }
    message.MergeFrom(*parsed);
  }
  return absl::OkStatus();
}

std::string Dump(const nlohmann::ordered_json& json) { return JsonText(json); }

}  // namespace meshwright
