// SPDX-License-Identifier: Apache-2.0
#include "coordinator/api/public_text.h"

#include <algorithm>
#include <string>

#include <absl/strings/match.h>

namespace meshwright {
namespace {

constexpr char kEndsOfWords[] = " \t\n\"'(),;<>";

bool IsPlace(const std::string& word) {
  if (word == "/v1" || absl::StartsWith(word, "/v1/")) return false;
  return (word.size() > 1 && word[0] == '/') || absl::StrContains(word, "://");
}

}  // namespace

std::string WithoutServerPaths(const std::string& text) {
  std::string clean;
  for (size_t begin = 0; begin < text.size();) {
    const size_t end = std::min(text.find_first_of(kEndsOfWords, begin), text.size());
    std::string word = text.substr(begin, end - begin);
    if (IsPlace(word)) {
      while (word.size() > 1 && word.back() == '/') word.pop_back();
      word.erase(0, word.rfind('/') + 1);
    }
    clean += word;
    if (end < text.size()) clean += text[end];
    begin = end + 1;
  }
  return clean;
}

}  // namespace meshwright
