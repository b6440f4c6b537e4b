// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>

#include <absl/status/status.h>
#include <absl/types/span.h>

#include "common/http_server/http_message.h"
#include "coordinator/nodeodm/multipart.h"

namespace meshwright {

// The body of a request that is a form, whatever way clients have of writing one: multipart, urlencoded or a JSON
// object. Fields are kept, up to 1 MiB in all; files go to whoever takes them.
class FormBody {
 public:
  // Takes parts that are files, named "images"; may be empty where none are wanted. append and end follow begin.
  FormBody(const std::string& content_type, FormPartHandler files);

  absl::Status Append(absl::Span<const uint8_t> bytes);
  // Errors of the whole form, InvalidArgument.
  absl::Status Finish();
  // The last one of this name; none when it was not there.
  std::optional<std::string> Field(const std::string& name) const;

 private:
  absl::Status BeginPart(const FormPart& part);
  absl::Status AppendToPart(absl::Span<const uint8_t> bytes);
  absl::Status EndPart();
  absl::Status AddToField(std::string& field, absl::Span<const uint8_t> bytes);

  const std::string content_type_;
  const FormPartHandler files_;
  std::unique_ptr<MultipartReader> multipart_;  // null for the other two
  std::string text_;                            // of the other two
  enum class Target { kNothing, kField, kFile } target_ = Target::kNothing;
  std::string name_;
  size_t field_bytes_ = 0;
  std::map<std::string, std::string> fields_;
};

}  // namespace meshwright
