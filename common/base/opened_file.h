// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>

#include <absl/status/statusor.h>

namespace meshwright {

// A file that is open for reading; it stays readable when its name is removed.
class OpenedFile {
 public:
  static absl::StatusOr<std::shared_ptr<const OpenedFile>> Open(const std::string& path);
  ~OpenedFile();
  OpenedFile(const OpenedFile&) = delete;
  OpenedFile& operator=(const OpenedFile&) = delete;

  int64_t size_bytes() const { return size_bytes_; }
  // Reads up to `count` bytes; DataLoss when there are none.
  absl::StatusOr<size_t> Read(int64_t offset, char* bytes, size_t count) const;

 private:
  OpenedFile(int descriptor, int64_t size_bytes) : descriptor_(descriptor), size_bytes_(size_bytes) {}
  const int descriptor_;
  const int64_t size_bytes_;
};

}  // namespace meshwright
