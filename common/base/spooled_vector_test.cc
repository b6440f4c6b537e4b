// SPDX-License-Identifier: Apache-2.0
#include "common/base/spooled_vector.h"

#include <csignal>
#include <filesystem>
#include <fstream>
#include <numeric>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include "common/base/temporary_folder_testing.h"

namespace meshwright {
namespace {

// Pages of files that this process has mapped and in memory.
int64_t MappedKilobytes() {
  std::ifstream status("/proc/self/status");
  std::string word;
  int64_t kilobytes = 0;
  while (status >> word) {
    if (word == "RssFile:" || word == "RssShmem:") {
      int64_t value = 0;
      status >> value;
      kilobytes += value;
    }
  }
  return kilobytes;
}

TEST(SpooledVector, HoldsWhatAVectorHolds) {
  const TemporaryFolder folder;
  for (const std::string& beside : {std::string(), folder / "mesh.ply"}) {
    SpooledVector<int64_t> spooled(beside);
    std::vector<int64_t> expected;
    for (int64_t i = 0; i < 300'000; ++i) {
      spooled.push_back(i * i);
      expected.push_back(i * i);
    }
    spooled.Release();
    EXPECT_TRUE(std::equal(spooled.begin(), spooled.end(), expected.begin(), expected.end()));
    spooled.Append(std::vector<int64_t>{7, 8});
    EXPECT_EQ(spooled.size(), expected.size() + 2);
    EXPECT_EQ(spooled.back(), 8);
    SpooledVector<int64_t> moved = std::move(spooled);
    EXPECT_EQ(moved[299'999], expected.back());
    moved.Shorten(3);
    EXPECT_EQ(std::accumulate(moved.begin(), moved.end(), int64_t{0}), 5);
    moved.assign(100'000, -1);
    EXPECT_EQ(std::accumulate(moved.begin(), moved.end(), int64_t{0}), -100'000);
    EXPECT_TRUE(std::filesystem::is_empty(folder.path())) << "the file has no name";
  }
}

TEST(SpooledVector, GivesMemoryBack) {
  const TemporaryFolder folder;
  SpooledVector<int64_t> spooled(folder / "mesh.ply");
  spooled.assign(4'000'000, 5);
  const int64_t before = MappedKilobytes();
  spooled.Release();
  EXPECT_LT(MappedKilobytes(), before - 25'000);
  EXPECT_EQ(std::accumulate(spooled.begin(), spooled.end(), int64_t{0}), 20'000'000);
}

TEST(SpooledVector, GoesOnInMemoryWhereNoFileCanBe) {
  SpooledVector<int> nowhere("/nowhere/at all");
  nowhere.assign(100'000, 3);
  nowhere.Release();
  EXPECT_EQ(std::accumulate(nowhere.begin(), nowhere.end(), 0), 300'000);
}

TEST(SpooledVector, GoesOnInMemoryWhenTheFileMayNotGrow) {
  const TemporaryFolder folder;
  SpooledVector<int> spooled(folder / "mesh.ply");
  spooled.assign(50'000, 3);
  rlimit limit{};
  ::getrlimit(RLIMIT_FSIZE, &limit);
  const rlimit small = {.rlim_cur = 300'000, .rlim_max = limit.rlim_max};
  ::signal(SIGXFSZ, SIG_IGN);
  ::setrlimit(RLIMIT_FSIZE, &small);
  for (int i = 0; i < 50'000; ++i) spooled.push_back(4);
  ::setrlimit(RLIMIT_FSIZE, &limit);
  spooled.Release();
  EXPECT_EQ(std::accumulate(spooled.begin(), spooled.end(), 0), 350'000);
}

}  // namespace
}  // namespace meshwright
