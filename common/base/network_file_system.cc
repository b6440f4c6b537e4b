// SPDX-License-Identifier: Apache-2.0
#include "common/base/network_file_system.h"

#include <algorithm>
#include <array>

#include <sys/vfs.h>

namespace meshwright {
namespace {

constexpr std::array<uint32_t, 9> kNetworkMagics = {
    0x6969,      // NFS
    0x517B,      // SMB
    0xFF534D42,  // CIFS
    0xFE534D42,  // SMB2
    0x0BD00BD0,  // Lustre
    0x47504653,  // GPFS
    0x19830326,  // BeeGFS
    0x00C36400,  // Ceph
    0x65735546,  // FUSE
};

}  // namespace

bool IsNetworkFileSystem(int64_t magic) {
  // The kernel's type is signed where ours is not.
  return std::find(kNetworkMagics.begin(), kNetworkMagics.end(), static_cast<uint32_t>(magic)) != kNetworkMagics.end();
}

bool IsOnNetworkFileSystem(const std::string& path) {
  struct statfs system = {};
  return ::statfs(path.c_str(), &system) == 0 && IsNetworkFileSystem(system.f_type);
}

}  // namespace meshwright
