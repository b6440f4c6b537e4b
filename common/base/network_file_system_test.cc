// SPDX-License-Identifier: Apache-2.0
#include "common/base/network_file_system.h"

#include <gtest/gtest.h>

namespace meshwright {
namespace {

TEST(NetworkFileSystemTest, IsToldByTheNumberOfItsKind) {
  for (const int64_t magic : {int64_t{0x6969}, int64_t{0x0BD00BD0}, int64_t{0x47504653}, int64_t{0x19830326},
                              int64_t{static_cast<int32_t>(0xFF534D42)}}) {
    EXPECT_TRUE(IsNetworkFileSystem(magic)) << magic;
  }
  for (const int64_t magic : {0xEF53 /* ext4 */, 0x58465342 /* XFS */, 0x01021994 /* tmpfs */, 0}) {
    EXPECT_FALSE(IsNetworkFileSystem(magic)) << magic;
  }
  EXPECT_FALSE(IsOnNetworkFileSystem("/proc"));
  EXPECT_FALSE(IsOnNetworkFileSystem("/no/such/folder"));
}

}  // namespace
}  // namespace meshwright
