// SPDX-License-Identifier: Apache-2.0
#include "common/mesh/formats/scratch_array.h"

#include <cerrno>
#include <cstring>

#include <absl/strings/str_cat.h>
#include <fcntl.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <unistd.h>

namespace meshwright {
namespace {

absl::Status ScratchError(const char* what, const std::string& beside, int error) {
  const std::string message =
      absl::StrCat(beside, ": cannot ", what, " a temporary file beside it: ", std::strerror(error));
  if (error == ENOSPC || error == EDQUOT) return absl::ResourceExhaustedError(message);
  return absl::InternalError(message);
}

}  // namespace

absl::StatusOr<std::shared_ptr<void>> MapScratch(size_t bytes, const std::string& beside) {
  if (bytes == 0) return nullptr;
  std::string name = beside + ".scratch-XXXXXX";
  const int descriptor = ::mkostemp(name.data(), O_CLOEXEC);
  if (descriptor < 0) return ScratchError("create", beside, errno);
  ::unlink(name.c_str());
  // Room is taken now: a mapped page that finds none later would end the process.
  const int full = ::posix_fallocate(descriptor, 0, static_cast<off_t>(bytes));
  void* mapped = full != 0 ? MAP_FAILED : ::mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_SHARED, descriptor, 0);
  const int error = full != 0 ? full : errno;
  ::close(descriptor);
  if (mapped == MAP_FAILED) return ScratchError("map", beside, error);
  return std::shared_ptr<void>(mapped, [bytes](void* at) { ::munmap(at, bytes); });
}

}  // namespace meshwright
