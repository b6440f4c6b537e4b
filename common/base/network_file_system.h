// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>

namespace meshwright {

// Whether a type of file system, as statfs names it, is shared between machines: NFS, SMB, Lustre, GPFS, BeeGFS, Ceph
// and whatever is in FUSE (sshfs). Processes on several machines share no memory there.
bool IsNetworkFileSystem(int64_t magic);
// Of the file or folder; false when it cannot be told.
bool IsOnNetworkFileSystem(const std::string& path);

}  // namespace meshwright
