// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include <absl/status/status.h>
#include <absl/types/span.h>

namespace meshwright {

// One part of a form: a field, or a file when it has a file name.
struct FormPart {
  std::string name;
  std::string file_name;
  bool is_file = false;
};

// What the reader of a form calls, in this order for each part. An error ends the form.
struct FormPartHandler {
  std::function<absl::Status(const FormPart& part)> begin;
  std::function<absl::Status(absl::Span<const uint8_t> bytes)> append;
  std::function<absl::Status()> end;
};

// multipart/form-data (RFC 7578), read as it arrives in pieces of any size: memory does not depend on the body. A part
// is ended only when the boundary behind it was there, so that an upload that broke off leaves none.
class MultipartReader {
 public:
  // `content_type`: the header of the request. InvalidArgument unless it is multipart/form-data with a boundary.
  static absl::Status Check(const std::string& content_type);

  // After Check() of the same header.
  MultipartReader(const std::string& content_type, FormPartHandler handler);

  // InvalidArgument when the body is not what it should be, and what the handler says.
  absl::Status Append(absl::Span<const uint8_t> bytes);
  // InvalidArgument when the last boundary has not come.
  absl::Status Finish() const;

 private:
  enum class State { kPreamble, kAfterBoundary, kHead, kBody, kEpilogue };
  absl::Status Step(bool* goes_on);
  absl::Status BeginPart(const std::string& head);

  const std::string delimiter_;  // CRLF, "--" and the boundary
  const FormPartHandler handler_;
  State state_ = State::kPreamble;
  std::string pending_;
  int parts_ = 0;
};

}  // namespace meshwright
