// SPDX-License-Identifier: Apache-2.0
#include "common/scene/formats/text_fields.h"

#include <charconv>
#include <cmath>
#include <limits>

#include <absl/strings/str_cat.h>

#include "common/base/files.h"
#include "common/base/status_macros.h"

namespace meshwright {
namespace {

constexpr std::string_view kWhiteSpace = " \t\r\n\v\f";

bool IsWhiteSpace(char c) { return kWhiteSpace.find(c) != std::string_view::npos; }

std::string_view Trimmed(std::string_view text) {
  const size_t begin = text.find_first_not_of(kWhiteSpace);
  if (begin == std::string_view::npos) return {};
  return text.substr(begin, text.find_last_not_of(kWhiteSpace) - begin + 1);
}

}  // namespace

std::string Place::ToString() const { return number == 0 ? file : absl::StrCat(file, ", ", unit, " ", number); }

absl::Status FieldError(const Place& place, const std::string& field, const std::string& value,
                        const std::string& expected) {
  return absl::InvalidArgumentError(
      absl::StrCat(place.ToString(), ": ", field, " is ", value, "; expected ", expected));
}

std::string Quoted(std::string_view value) {
  constexpr size_t kLongest = 40;
  std::string quoted = "\"";
  for (const char c : value.substr(0, kLongest)) {
    const auto code = static_cast<unsigned char>(c);
    quoted += code >= 0x20 && code < 0x7F ? c : '?';
  }
  return quoted + (value.size() > kLongest ? "...\"" : "\"");
}

absl::StatusOr<std::string> ReadTextFile(const std::string& path) {
  constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";
  MW_ASSIGN_OR_RETURN(std::string text, ReadFile(path));
  if (text.compare(0, kByteOrderMark.size(), kByteOrderMark) == 0) text.erase(0, kByteOrderMark.size());
  return text;
}

bool TextLines::Next(std::string_view* line) {
  if (rest_.empty()) return false;
  const size_t end = rest_.find('\n');
  *line = rest_.substr(0, end);
  rest_.remove_prefix(end == std::string_view::npos ? rest_.size() : end + 1);
  if (!line->empty() && line->back() == '\r') line->remove_suffix(1);
  ++number_;
  return true;
}

bool TextLines::NextContent(std::string_view* line) {
  while (Next(line)) {
    const std::string_view content = Trimmed(*line);
    if (!content.empty() && content.front() != '#') return true;
  }
  return false;
}

bool TextFields::AtEnd() {
  while (!rest_.empty() && IsWhiteSpace(rest_.front())) {
    if (rest_.front() == '\n') ++place_.number;
    rest_.remove_prefix(1);
  }
  return rest_.empty();
}

absl::StatusOr<std::string_view> TextFields::Word(const char* field) {
  if (AtEnd()) return absl::InvalidArgumentError(absl::StrCat(place_.ToString(), ": ends early; expected ", field));
  size_t length = 1;
  while (length < rest_.size() && !IsWhiteSpace(rest_[length])) ++length;
  const std::string_view word = rest_.substr(0, length);
  rest_.remove_prefix(length);
  return word;
}

absl::StatusOr<double> TextFields::Number(const char* field) {
  TextFields before = *this;
  MW_ASSIGN_OR_RETURN(const double value, NumberOrNone(field));
  if (std::isfinite(value)) return value;
  MW_ASSIGN_OR_RETURN(const std::string_view word, before.Word(field));
  return FieldError(place_, field, Quoted(word), "a finite number");
}

absl::StatusOr<double> TextFields::NumberOrNone(const char* field) {
  MW_ASSIGN_OR_RETURN(const std::string_view word, Word(field));
  const std::string_view digits = word.front() == '+' ? word.substr(1) : word;
  double value = std::numeric_limits<double>::quiet_NaN();
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
  if (error != std::errc() || end != digits.data() + digits.size()) {
    return FieldError(place_, field, Quoted(word), "a finite number");
  }
  return value;
}

absl::StatusOr<int64_t> TextFields::Integer(const char* field, int64_t smallest, int64_t largest) {
  MW_ASSIGN_OR_RETURN(const std::string_view word, Word(field));
  int64_t value = 0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (error != std::errc() || end != word.data() + word.size() || value < smallest || value > largest) {
    return FieldError(place_, field, Quoted(word), absl::StrCat("an integer from ", smallest, " to ", largest));
  }
  return value;
}

absl::StatusOr<std::string_view> TextFields::Rest(const char* field) {
  if (AtEnd()) return absl::InvalidArgumentError(absl::StrCat(place_.ToString(), ": ends early; expected ", field));
  const std::string_view rest = Trimmed(rest_);
  rest_ = {};
  return rest;
}

absl::Status TextFields::ExpectEnd() {
  if (AtEnd()) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat(place_.ToString(), ": goes on with ", Quoted(rest_), "; expected the end"));
}

}  // namespace meshwright
