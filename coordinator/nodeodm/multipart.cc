// SPDX-License-Identifier: Apache-2.0
#include "coordinator/nodeodm/multipart.h"

#include <algorithm>
#include <optional>
#include <utility>

#include <absl/strings/ascii.h>
#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_split.h>

#include "common/base/status_macros.h"

namespace meshwright {
namespace {

constexpr size_t kMaxBoundary = 200;
constexpr size_t kMaxHead = 8192;  // header fields of a part
constexpr int kMaxParts = 100'000;
constexpr char kNewLine[] = "\r\n";
constexpr char kHeadEnd[] = "\r\n\r\n";

// The value of a parameter of a header field (`form-data; name="images"; filename="a.jpg"`), without its quotation
// marks.
std::optional<std::string> Parameter(const std::string& field, const std::string& name) {
  size_t at = field.find(';');
  while (at != std::string::npos && at < field.size()) {
    ++at;
    while (at < field.size() && absl::ascii_isspace(static_cast<unsigned char>(field[at]))) ++at;
    const size_t equals = field.find('=', at);
    if (equals == std::string::npos) return std::nullopt;
    const std::string key = field.substr(at, equals - at);
    std::string value;
    at = equals + 1;
    if (at < field.size() && field[at] == '"') {
      // Browsers write %22 for a quotation mark, others a backslash before it; backslashes of Windows' paths stay.
      for (++at; at < field.size() && field[at] != '"'; ++at) {
        if (field[at] == '\\' && at + 1 < field.size() && field[at + 1] == '"') ++at;
        value.push_back(field[at]);
      }
      at = field.find(';', at);
    } else {
      const size_t end = std::min(field.find(';', at), field.size());
      value = std::string(absl::StripAsciiWhitespace(field.substr(at, end - at)));
      at = end;
    }
    if (absl::EqualsIgnoreCase(key, name)) return value;
  }
  return std::nullopt;
}

// utf-8''na%C3%AFve.jpg (RFC 5987)
std::string DecodeExtended(const std::string& value) {
  const size_t begin = value.find('\'') == std::string::npos ? 0 : value.find('\'', value.find('\'') + 1) + 1;
  std::string decoded;
  for (size_t i = begin; i < value.size(); ++i) {
    const bool is_escape = value[i] == '%' && i + 2 < value.size() &&
                           absl::ascii_isxdigit(static_cast<unsigned char>(value[i + 1])) &&
                           absl::ascii_isxdigit(static_cast<unsigned char>(value[i + 2]));
    decoded.push_back(is_escape ? static_cast<char>(std::stoi(value.substr(i + 1, 2), nullptr, 16)) : value[i]);
    if (is_escape) i += 2;
  }
  return decoded;
}

std::optional<std::string> BoundaryOf(const std::string& content_type) {
  if (!absl::StartsWithIgnoreCase(content_type, "multipart/form-data")) return std::nullopt;
  std::optional<std::string> boundary = Parameter(content_type, "boundary");
  if (!boundary || boundary->empty() || boundary->size() > kMaxBoundary) return std::nullopt;
  return boundary;
}

}  // namespace

absl::Status MultipartReader::Check(const std::string& content_type) {
  if (BoundaryOf(content_type)) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat("Content-Type is \"", content_type.substr(0, 64),
                                                 "\", expected multipart/form-data with a boundary"));
}

// A line break in front makes the first boundary look like the others.
MultipartReader::MultipartReader(const std::string& content_type, FormPartHandler handler)
    : delimiter_(absl::StrCat(kNewLine, "--", BoundaryOf(content_type).value_or(""))),
      handler_(std::move(handler)),
      pending_(kNewLine) {}

absl::Status MultipartReader::Append(absl::Span<const uint8_t> bytes) {
  pending_.append(bytes.begin(), bytes.end());
  for (bool goes_on = true; goes_on;) MW_RETURN_IF_ERROR(Step(&goes_on));
  return absl::OkStatus();
}

absl::Status MultipartReader::Finish() const {
  if (state_ == State::kEpilogue) return absl::OkStatus();
  return absl::InvalidArgumentError("the form breaks off");
}

absl::Status MultipartReader::Step(bool* goes_on) {
  *goes_on = false;
  switch (state_) {
    case State::kPreamble:
    case State::kBody: {
      const size_t found = pending_.find(delimiter_);
      // What could be the beginning of a boundary stays.
      const size_t kept = std::min(pending_.size(), delimiter_.size() - 1);
      const size_t ready = found != std::string::npos ? found : pending_.size() - kept;
      if (state_ == State::kBody && ready > 0) {
        MW_RETURN_IF_ERROR(
            handler_.append(absl::MakeConstSpan(reinterpret_cast<const uint8_t*>(pending_.data()), ready)));
      }
      pending_.erase(0, ready);
      if (found == std::string::npos) return absl::OkStatus();
      pending_.erase(0, delimiter_.size());
      const bool ends_part = state_ == State::kBody;
      state_ = State::kAfterBoundary;
      *goes_on = true;
      return ends_part ? handler_.end() : absl::OkStatus();
    }
    case State::kAfterBoundary: {
      if (pending_.size() < 2) return absl::OkStatus();
      if (absl::StartsWith(pending_, "--")) {
        state_ = State::kEpilogue;
      } else {
        // Blanks may follow the boundary.
        const size_t line = pending_.find(kNewLine);
        if (line == std::string::npos && pending_.size() < kMaxHead) return absl::OkStatus();
        if (line == std::string::npos || pending_.find_first_not_of(" \t") != line) {
          return absl::InvalidArgumentError("the form has something behind a boundary");
        }
        pending_.erase(0, line);  // the head may be empty: its end begins with this line break
        state_ = State::kHead;
      }
      *goes_on = true;
      return absl::OkStatus();
    }
    case State::kHead: {
      const size_t end = pending_.find(kHeadEnd);
      if (std::min(end, pending_.size()) > kMaxHead) {
        return absl::InvalidArgumentError(
            absl::StrCat("a part of the form has a head of more than ", kMaxHead, " bytes"));
      }
      if (end == std::string::npos) return absl::OkStatus();
      const std::string head = pending_.substr(0, end);
      pending_.erase(0, end + sizeof(kHeadEnd) - 1);
      state_ = State::kBody;
      *goes_on = true;
      return BeginPart(head);
    }
    case State::kEpilogue:
      pending_.clear();
      return absl::OkStatus();
  }
  return absl::OkStatus();
}

absl::Status MultipartReader::BeginPart(const std::string& head) {
  if (++parts_ > kMaxParts) {
    return absl::InvalidArgumentError(absl::StrCat("the form has more than ", kMaxParts, " parts"));
  }
  for (const std::string& line : std::vector<std::string>(absl::StrSplit(head, kNewLine))) {
    constexpr char kDisposition[] = "content-disposition:";
    if (!absl::StartsWithIgnoreCase(line, kDisposition)) continue;
    FormPart part;
    const std::optional<std::string> name = Parameter(line, "name");
    std::optional<std::string> file_name = Parameter(line, "filename");
    if (const auto extended = Parameter(line, "filename*")) file_name = DecodeExtended(*extended);
    if (!name) break;
    part.name = *name;
    part.is_file = file_name.has_value();
    part.file_name = file_name.value_or("");
    return handler_.begin(part);
  }
  return absl::InvalidArgumentError("a part of the form has no Content-Disposition with a name");
}

}  // namespace meshwright
