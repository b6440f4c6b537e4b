// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

namespace meshwright {

// Where in a scene's file something stands, for errors: "folder/images.txt, line 12".
struct Place {
  std::string file;
  const char* unit = "line";  // or "record" in binary files
  int64_t number = 0;         // from 1; 0: the file as a whole

  std::string ToString() const;
};

// InvalidArgument: "<place>: <field> is <value>; expected <expected>".
absl::Status FieldError(const Place& place, const std::string& field, const std::string& value,
                        const std::string& expected);
// `value` as it can be shown in one line: quoted, cut, without control characters.
std::string Quoted(std::string_view value);

// ReadFile for text: a byte order mark (UTF-8), which editors leave, is skipped.
absl::StatusOr<std::string> ReadTextFile(const std::string& path);

// Lines of a text, without their ends (LF or CR LF).
class TextLines {
 public:
  explicit TextLines(std::string_view text) : rest_(text) {}
  // False at the end of the text.
  bool Next(std::string_view* line);
  // The next line that is neither blank nor a comment (#).
  bool NextContent(std::string_view* line);
  // Number of the line that was read last, from 1.
  int64_t number() const { return number_; }

 private:
  std::string_view rest_;
  int64_t number_ = 0;
};

// Reads a text field by field; fields are separated by white space. The text may have several lines: the place follows.
// Errors name the place, the field, its value and what was expected.
class TextFields {
 public:
  TextFields(std::string_view text, Place place) : rest_(text), place_(std::move(place)) {}

  const Place& place() const { return place_; }
  bool AtEnd();
  absl::StatusOr<std::string_view> Word(const char* field);
  // A finite number.
  absl::StatusOr<double> Number(const char* field);
  // The same, or "nan" and "inf", by which some files say that there is none.
  absl::StatusOr<double> NumberOrNone(const char* field);
  absl::StatusOr<int64_t> Integer(const char* field, int64_t smallest, int64_t largest);
  // What is left, without white space around it; not empty.
  absl::StatusOr<std::string_view> Rest(const char* field);
  absl::Status ExpectEnd();

 private:
  std::string_view rest_;
  Place place_;
};

}  // namespace meshwright
