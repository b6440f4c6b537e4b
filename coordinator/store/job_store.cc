// SPDX-License-Identifier: Apache-2.0
#include "coordinator/store/job_store.h"

#include <absl/strings/numbers.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>
#include <absl/strings/str_split.h>

namespace meshwright {

std::string JoinCameraIndices(const std::vector<CameraIndex>& cameras) { return absl::StrJoin(cameras, ","); }

absl::StatusOr<std::vector<CameraIndex>> SplitCameraIndices(const std::string& text) {
  std::vector<CameraIndex> cameras;
  if (text.empty()) return cameras;
  for (const auto& part : absl::StrSplit(text, ',')) {
    CameraIndex camera = 0;
    if (!absl::SimpleAtoi(part, &camera)) {
      return absl::DataLossError(absl::StrCat("camera indices expected, got \"", text, "\""));
    }
    cameras.push_back(camera);
  }
  return cameras;
}

namespace {

// Length of the UTF-8 sequence that begins at text[at], 0 when there is none (Unicode 15, table 3-7).
size_t Utf8Length(const std::string& text, size_t at) {
  const auto byte = [&](size_t i) { return i < text.size() ? static_cast<uint8_t>(text[i]) : uint8_t{0}; };
  const uint8_t first = byte(at);
  if (first != 0 && first < 0x80) return 1;
  const size_t length = first >= 0xc2 && first <= 0xdf   ? 2
                        : (first & 0xf0) == 0xe0         ? 3
                        : first >= 0xf0 && first <= 0xf4 ? 4
                                                         : 0;
  for (size_t i = 1; i < length; ++i) {
    if ((byte(at + i) & 0xc0) != 0x80) return 0;
  }
  const uint8_t second = byte(at + 1);
  const bool overlong = (first == 0xe0 && second < 0xa0) || (first == 0xf0 && second < 0x90);
  const bool no_character = (first == 0xed && second > 0x9f) || (first == 0xf4 && second > 0x8f);
  return overlong || no_character ? 0 : length;
}

}  // namespace

std::string PrintableText(const std::string& text) {
  std::string printable;
  for (size_t at = 0; at < text.size();) {
    const size_t length = Utf8Length(text, at);
    printable += length == 0 ? "?" : text.substr(at, length);
    at += length == 0 ? 1 : length;
  }
  return printable;
}

bool IsFinal(ReconstructionState state) {
  return state == ReconstructionState::kDone || state == ReconstructionState::kCancelled ||
         state == ReconstructionState::kFailed;
}

}  // namespace meshwright
