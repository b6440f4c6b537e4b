// SPDX-License-Identifier: Apache-2.0
// Writes what a fuzzer starts from: FOLDER/TARGET/seed-N, and FOLDER/TARGET.dict. Prints the targets' names.
#include <cstdio>
#include <filesystem>
#include <string>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include "common/base/check.h"
#include "common/base/files.h"
#include "tests/fuzz/target.h"

namespace {

// libFuzzer's syntax: all but letters and digits by their number.
std::string Quoted(const std::string& word) {
  std::string text = "\"";
  for (const char c : word) absl::StrAppendFormat(&text, "\\x%02X", static_cast<unsigned char>(c));
  return text + "\"\n";
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "Usage: fuzz_corpus FOLDER\n");
    return 2;
  }
  for (const auto& target : meshwright::fuzz::Targets()) {
    const std::string folder = absl::StrCat(argv[1], "/", target.name);
    std::filesystem::create_directories(folder);
    for (size_t i = 0; i < target.seeds.size(); ++i) {
      MW_CHECK(meshwright::WriteFileAtomically(absl::StrCat(folder, "/seed-", i), target.seeds[i]).ok());
    }
    std::string dictionary;
    for (const std::string& word : target.dictionary) dictionary += Quoted(word);
    MW_CHECK(meshwright::WriteFileAtomically(folder + ".dict", dictionary).ok());
    std::printf("%s\n", target.name.c_str());
  }
  return 0;
}
