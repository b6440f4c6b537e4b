// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <fstream>
#include <string>
#include <utility>

#include <gtest/gtest.h>
#include <sys/mount.h>

namespace meshwright::faults {

// A file system that is full soon. Only root can have one.
class SmallDisk {
 public:
  explicit SmallDisk(std::string path, const std::string& size = "128m") : path_(std::move(path)) {
    std::filesystem::create_directories(path_);
    mounted_ = ::mount("tmpfs", path_.c_str(), "tmpfs", 0, ("size=" + size).c_str()) == 0;
  }
  ~SmallDisk() {
    if (mounted_) ::umount2(path_.c_str(), MNT_DETACH);
  }
  SmallDisk(const SmallDisk&) = delete;
  SmallDisk& operator=(const SmallDisk&) = delete;

  bool mounted() const { return mounted_; }
  const std::string& path() const { return path_; }
  // Leaves less than this. Others may write meanwhile and fill it first, so that a failing write is what is wanted too.
  void Fill(uintmax_t bytes_left) const {
    const uintmax_t free = std::filesystem::space(path_).available;
    if (free > bytes_left) std::ofstream(path_ + "/ballast") << std::string(free - bytes_left, 'x');
    EXPECT_LE(std::filesystem::space(path_).available, bytes_left);
  }
  void Empty() const { std::filesystem::remove(path_ + "/ballast"); }

 private:
  std::string path_;
  bool mounted_ = false;
};

}  // namespace meshwright::faults
