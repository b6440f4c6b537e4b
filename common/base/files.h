// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <absl/time/time.h>
#include <absl/types/span.h>

namespace meshwright {

// Errors name the path and the system's reason. NotFound when there is no such file.
absl::StatusOr<std::string> ReadFile(const std::string& path);

// A file that appears whole or not at all: written beside its final name, synced, then renamed. Destroying it without
// Commit() removes what was written. A symbolic link stays and the file it points at is replaced; what is no regular
// file (a folder, a device) is refused with InvalidArgument.
class AtomicFile {
 public:
  static absl::StatusOr<AtomicFile> Create(const std::string& path);
  AtomicFile(AtomicFile&& other) noexcept;
  AtomicFile& operator=(AtomicFile&& other) = delete;
  AtomicFile(const AtomicFile&) = delete;
  ~AtomicFile();

  absl::Status Append(absl::Span<const uint8_t> bytes);
  absl::Status Append(const std::string& bytes);
  // Overwrites bytes that were already appended (a header whose counts are known only at the end).
  absl::Status WriteAt(int64_t offset, const std::string& bytes);
  absl::Status Commit();

 private:
  AtomicFile(std::string path, std::string temporary_path, int descriptor);
  absl::Status Flush();
  std::string path_;
  std::string temporary_path_;
  int descriptor_ = -1;
  std::vector<uint8_t> buffer_;
};

absl::Status WriteFileAtomically(const std::string& path, const std::string& bytes);
absl::Status WriteFileAtomically(const std::string& path, absl::Span<const uint8_t> bytes);

// The name of a file beside `path` that nobody else in this or another process uses: what is being written and not
// `path` yet. Such files are what the next two functions remove.
std::string PartialPath(const std::string& path);

// Removes what processes that died while they wrote `path` left beside it. Errors are ignored: it is a matter of space.
void RemovePartialFiles(const std::string& path);

// Removes what AtomicFiles of processes that died left in `folder` and below, when nothing was written to it since
// `oldest`. Errors are ignored: it is a matter of space only.
void RemoveStalePartialFiles(const std::string& folder, absl::Time oldest);

}  // namespace meshwright
