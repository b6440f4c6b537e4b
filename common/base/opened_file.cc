// SPDX-License-Identifier: Apache-2.0
#include "common/base/opened_file.h"

#include <cerrno>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

namespace meshwright {

absl::StatusOr<std::shared_ptr<const OpenedFile>> OpenedFile::Open(const std::string& path) {
  const int descriptor = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  struct stat status = {};
  if (descriptor >= 0 && ::fstat(descriptor, &status) == 0 && S_ISREG(status.st_mode)) {
    return std::shared_ptr<const OpenedFile>(new OpenedFile(descriptor, status.st_size));
  }
  if (descriptor >= 0) ::close(descriptor);
  return errno == ENOENT ? absl::NotFoundError("the file is not there")
                         : absl::DataLossError("the file cannot be read");
}

OpenedFile::~OpenedFile() { ::close(descriptor_); }

absl::StatusOr<size_t> OpenedFile::Read(int64_t offset, char* bytes, size_t count) const {
  while (true) {
    const ssize_t got = ::pread(descriptor_, bytes, count, offset);
    if (got > 0) return static_cast<size_t>(got);
    if (got == 0 || errno != EINTR) return absl::DataLossError("the file cannot be read");
  }
}

}  // namespace meshwright
