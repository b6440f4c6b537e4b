// SPDX-License-Identifier: Apache-2.0
#include "program/settings_file.h"

#include <algorithm>
#include <sstream>

#include <absl/strings/ascii.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/strip.h>

#include "common/base/status_macros.h"

namespace meshwright {
namespace {

constexpr size_t kMaxBytes = size_t{1} << 20;

bool IsName(const std::string& text) {
  const auto allowed = [](unsigned char c) {
    return absl::ascii_islower(c) || absl::ascii_isdigit(c) || c == '-' || c == '_';
  };
  return !text.empty() && std::ranges::all_of(text, allowed);
}

bool IsText(const std::string& line) {
  return std::ranges::none_of(line, [](unsigned char c) { return absl::ascii_iscntrl(c) && c != '\t'; });
}

std::string WithoutQuotes(const std::string& value) {
  const bool quoted =
      value.size() >= 2 && value.front() == value.back() && (value.front() == '"' || value.front() == '\'');
  return quoted ? value.substr(1, value.size() - 2) : value;
}

absl::StatusOr<Setting> ParseLine(const std::string& line, const std::string& source) {
  const size_t equals = line.find('=');
  const std::string name(absl::StripAsciiWhitespace(line.substr(0, equals)));
  if (equals == std::string::npos || !IsName(name) || !IsText(line)) {
    return absl::InvalidArgumentError(absl::StrCat(source, ": expected name = value"));
  }
  const std::string value(absl::StripAsciiWhitespace(line.substr(equals + 1)));
  return Setting{.name = name, .value = WithoutQuotes(value), .source = source};
}

}  // namespace

absl::StatusOr<std::vector<Setting>> ParseSettingsFile(const std::string& path, const std::string& text) {
  if (text.size() > kMaxBytes) {
    return absl::InvalidArgumentError(
        absl::StrCat(path, ": a configuration file has at most ", kMaxBytes, " bytes, this one ", text.size()));
  }
  std::vector<Setting> settings;
  std::istringstream lines(text);
  int number = 0;
  for (std::string line; std::getline(lines, line);) {
    ++number;
    if (!line.empty() && line.back() == '\r') line.pop_back();
    const std::string content(absl::StripAsciiWhitespace(line));
    if (content.empty() || content.front() == '#' || content.front() == ';') continue;
    MW_ASSIGN_OR_RETURN(Setting setting, ParseLine(content, absl::StrCat(path, ":", number)));
    settings.push_back(std::move(setting));
  }
  return settings;
}

}  // namespace meshwright
