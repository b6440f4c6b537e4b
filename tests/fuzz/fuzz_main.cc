// SPDX-License-Identifier: Apache-2.0
// libFuzzer's side: one program for all targets; MESHWRIGHT_FUZZ_TARGET names the one that is run.
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <string>

#include "tests/fuzz/target.h"

namespace {

const meshwright::fuzz::Target& ChosenTarget() {
  static const meshwright::fuzz::Target* const target = [] {
    const char* const name = std::getenv("MESHWRIGHT_FUZZ_TARGET");
    const auto* const found = meshwright::fuzz::FindTarget(name == nullptr ? "" : name);
    if (found == nullptr) {
      std::fprintf(stderr, "MESHWRIGHT_FUZZ_TARGET names no target; there are:\n");
      for (const auto& one : meshwright::fuzz::Targets()) std::fprintf(stderr, "  %s\n", one.name.c_str());
      std::exit(2);
    }
    return found;
  }();
  return *target;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  ChosenTarget().run(std::string(reinterpret_cast<const char*>(data), size));
  return 0;
}
