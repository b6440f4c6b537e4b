// SPDX-License-Identifier: Apache-2.0
// Every parser on what once broke it, on what is right, on every beginning of that, and on some thousand changes of it.
// scripts/fuzz looks further.
#include <algorithm>
#include <filesystem>
#include <random>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "common/base/clock.h"
#include "common/base/files.h"
#include "tests/fuzz/target.h"

namespace meshwright::fuzz {
namespace {

namespace fs = std::filesystem;

constexpr double kSecondsPerTarget = 2;

class FuzzTest : public testing::TestWithParam<std::string> {
 protected:
  const Target& target_ = *FindTarget(GetParam());
};

std::string Changed(std::string text, const Target& target, std::mt19937& random) {
  const auto below = [&](size_t most) { return most == 0 ? 0 : random() % most; };
  for (size_t changes = 1 + below(4); changes > 0; --changes) {
    const size_t at = below(text.size() + 1);
    switch (below(6)) {
      case 0:
        if (at < text.size()) text[at] = static_cast<char>(random());
        break;
      case 1:
        if (at < text.size()) text[at] = static_cast<char>(text[at] ^ (1 << below(8)));
        break;
      case 2:
        text.erase(at, below(20));
        break;
      case 3:
        text.insert(at, text.substr(below(text.size() + 1), below(40)));
        break;
      case 4:
        if (!target.dictionary.empty()) text.insert(at, target.dictionary[below(target.dictionary.size())]);
        break;
      default:
        text.replace(at, std::min<size_t>(text.size() - at, 4),
                     std::string(below(5), random() % 2 == 0 ? '\xFF' : '9'));
    }
  }
  return text;
}

TEST_P(FuzzTest, WhatOnceBrokeIt) {
  const fs::path folder = fs::path(MW_SOURCE_FOLDER "/tests/fuzz/regressions") / GetParam();
  if (!fs::exists(folder)) return;
  for (const auto& entry : fs::directory_iterator(folder)) {
    SCOPED_TRACE(entry.path().string());
    target_.run(*ReadFile(entry.path().string()));
  }
}

TEST_P(FuzzTest, BeginningsOfWhatIsRight) {
  const Stopwatch stopwatch;
  for (const std::string& seed : target_.seeds) {
    target_.run(seed);
    const size_t step = std::max<size_t>(1, seed.size() / 300);
    for (size_t size = 0; size < seed.size() && stopwatch.Seconds() < kSecondsPerTarget; size += step) {
      target_.run(seed.substr(0, size));
    }
  }
}

TEST_P(FuzzTest, ChangesOfWhatIsRight) {
  std::mt19937 random(20091);
  const Stopwatch stopwatch;
  for (int i = 0; i < 20'000 && stopwatch.Seconds() < kSecondsPerTarget; ++i) {
    target_.run(Changed(target_.seeds[random() % target_.seeds.size()], target_, random));
  }
}

std::vector<std::string> Names() {
  std::vector<std::string> names;
  for (const Target& target : Targets()) names.push_back(target.name);
  return names;
}

INSTANTIATE_TEST_SUITE_P(All, FuzzTest, testing::ValuesIn(Names()), [](const auto& info) { return info.param; });

TEST(FuzzRegressions, BelongToATarget) {
  for (const auto& entry : fs::directory_iterator(MW_SOURCE_FOLDER "/tests/fuzz/regressions")) {
    if (entry.is_directory()) EXPECT_NE(FindTarget(entry.path().filename().string()), nullptr) << entry.path();
  }
}

}  // namespace
}  // namespace meshwright::fuzz
