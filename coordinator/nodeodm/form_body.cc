// SPDX-License-Identifier: Apache-2.0
#include "coordinator/nodeodm/form_body.h"

#include <utility>

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>

#include "common/base/status_macros.h"
#include "common/json/json_text.h"
#include "common/json/parse_json.h"

namespace meshwright {
namespace {

constexpr size_t kMaxFieldBytes = size_t{1} << 20;
constexpr int kMaxJsonDepth = 20;
constexpr char kFiles[] = "images";

}  // namespace

FormBody::FormBody(const std::string& content_type, FormPartHandler files)
    : content_type_(content_type), files_(std::move(files)) {
  if (!MultipartReader::Check(content_type).ok()) return;
  multipart_ = std::make_unique<MultipartReader>(
      content_type, FormPartHandler{.begin = [this](const FormPart& part) { return BeginPart(part); },
                                    .append = [this](absl::Span<const uint8_t> bytes) { return AppendToPart(bytes); },
                                    .end = [this] { return EndPart(); }});
}

absl::Status FormBody::Append(absl::Span<const uint8_t> bytes) {
  if (multipart_ != nullptr) return multipart_->Append(bytes);
  return AddToField(text_, bytes);
}

absl::Status FormBody::AddToField(std::string& field, absl::Span<const uint8_t> bytes) {
  field_bytes_ += bytes.size();
  if (field_bytes_ > kMaxFieldBytes) {
    return absl::InvalidArgumentError(
        absl::StrCat("the form has more than ", kMaxFieldBytes, " bytes beside its files"));
  }
  field.append(bytes.begin(), bytes.end());
  return absl::OkStatus();
}

absl::Status FormBody::BeginPart(const FormPart& part) {
  name_ = part.name;
  target_ = Target::kField;
  if (!part.is_file) {
    fields_[name_].clear();
    return absl::OkStatus();
  }
  // Files under another name are nobody's.
  target_ = name_ == kFiles && files_.begin ? Target::kFile : Target::kNothing;
  return target_ == Target::kFile ? files_.begin(part) : absl::OkStatus();
}

absl::Status FormBody::AppendToPart(absl::Span<const uint8_t> bytes) {
  if (target_ == Target::kFile) return files_.append(bytes);
  return target_ == Target::kField ? AddToField(fields_[name_], bytes) : absl::OkStatus();
}

absl::Status FormBody::EndPart() { return target_ == Target::kFile ? files_.end() : absl::OkStatus(); }

absl::Status FormBody::Finish() {
  if (multipart_ != nullptr) return multipart_->Finish();
  if (absl::StartsWithIgnoreCase(content_type_, "application/json")) {
    const auto json =
        ParseJson(text_.empty() ? "{}" : text_, {.max_bytes = kMaxFieldBytes, .max_depth = kMaxJsonDepth});
    if (!json.ok()) return absl::InvalidArgumentError(absl::StrCat("the body ", std::string(json.status().message())));
    if (!json->is_object()) return absl::InvalidArgumentError("the body is no JSON object");
    for (const auto& [name, value] : json->items()) {
      fields_[name] = value.is_string() ? value.get<std::string>() : JsonText(value);
    }
    return absl::OkStatus();
  }
  HttpRequest form;
  if (!ParseTarget("/?" + text_, form)) return absl::InvalidArgumentError("the body is no form");
  for (const auto& [name, value] : form.params) fields_[name] = value;
  return absl::OkStatus();
}

std::optional<std::string> FormBody::Field(const std::string& name) const {
  const auto found = fields_.find(name);
  if (found == fields_.end()) return std::nullopt;
  return found->second;
}

}  // namespace meshwright
