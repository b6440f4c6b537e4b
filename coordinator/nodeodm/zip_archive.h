// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "common/base/opened_file.h"

namespace meshwright {

// A file that goes into an archive as it is.
struct ZipEntry {
  std::string name;  // with "/" between its parts
  std::string path;  // where it lies
  int64_t size_bytes = 0;
  uint32_t crc32 = 0;
};

// Reads the file once. Errors: those of OpenedFile.
absl::StatusOr<ZipEntry> MakeZipEntry(const std::string& name, const std::string& path);

// A zip of files that are stored, not compressed (APPNOTE 6.3), without ever being written: its length is known, and
// any range of it can be read. The same entries give the same bytes; ZIP64 where sizes need it.
class ZipArchive {
 public:
  // NotFound or DataLoss when a file is not there with its size any more. Files stay readable when they are removed.
  static absl::StatusOr<std::shared_ptr<const ZipArchive>> Open(const std::vector<ZipEntry>& entries);

  int64_t size_bytes() const { return size_bytes_; }
  // Up to `most` bytes from `offset` on, at least one where there are some.
  absl::StatusOr<std::string> Read(int64_t offset, size_t most) const;

 private:
  // Bytes of the archive that lie together: headers, or a file.
  struct Segment {
    int64_t begin = 0;
    int64_t size_bytes = 0;
    std::string bytes;
    std::shared_ptr<const OpenedFile> file;
  };
  void Add(std::string bytes);

  std::vector<Segment> segments_;
  int64_t size_bytes_ = 0;
};

}  // namespace meshwright
