// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include <absl/status/statusor.h>

namespace meshwright {

// Keeps other processes out of a folder as long as it lives, by a lock on the file `lock` in it, which says who holds
// it (host and process). The system drops the lock of a process that dies. The file itself stays.
class FolderLock {
 public:
  static constexpr char kFileName[] = "lock";

  // The folder must exist. Unavailable: another process, which the message names, holds it.
  static absl::StatusOr<FolderLock> Acquire(const std::string& folder);
  FolderLock(FolderLock&& other) noexcept;
  FolderLock& operator=(FolderLock&& other) noexcept;
  FolderLock(const FolderLock&) = delete;
  ~FolderLock();

 private:
  explicit FolderLock(int descriptor) : descriptor_(descriptor) {}
  int descriptor_ = -1;
};

}  // namespace meshwright
