// SPDX-License-Identifier: Apache-2.0
#include "program/console.h"

#include <cmath>
#include <cstdio>

#include <absl/strings/str_format.h>

#include "common/base/bad_input.h"
#include "common/json/json_text.h"

namespace meshwright {
namespace {

void PrintError(std::string message) {
  for (char& c : message) {
    if (c == '\n' || c == '\r') c = ' ';
  }
  std::fprintf(stderr, "meshwright: %s\n", message.c_str());
}

}  // namespace

int Fail(const absl::Status& status) {
  PrintError(std::string(status.message()));
  return IsBadInput(status) ? kExitBadInput : kExitFailed;
}

void Warn(const std::string& message) { PrintError("warning: " + message); }

int FailWrongUse(const std::string& message) {
  PrintError(message);
  return kExitWrongUse;
}

void PrintJson(const nlohmann::ordered_json& json) { std::printf("%s\n", JsonText(json, 2).c_str()); }

std::string FormatDuration(double seconds) {
  const auto total = static_cast<int64_t>(std::llround(seconds));
  const int64_t hours = total / 3600;
  if (hours > 0) return absl::StrFormat("%d:%02d:%02d", hours, total / 60 % 60, total % 60);
  return absl::StrFormat("%d:%02d", total / 60, total % 60);
}

std::string FormatBytes(double bytes) {
  const double mebibytes = bytes / (1 << 20);
  return mebibytes < 1024 ? absl::StrFormat("%.0f MiB", mebibytes) : absl::StrFormat("%.1f GiB", mebibytes / 1024);
}

std::string FormatCount(int64_t count) {
  const std::string digits = absl::StrFormat("%d", count);
  std::string text;
  for (size_t i = 0; i < digits.size(); ++i) {
    const bool thousand = (digits.size() - i) % 3 == 0;
    if (i > 0 && thousand && digits[i - 1] != '-') text.push_back(',');
    text.push_back(digits[i]);
  }
  return text;
}

}  // namespace meshwright
