// SPDX-License-Identifier: Apache-2.0
#include "common/mesh/formats/scratch_array.h"

#include <cerrno>

#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

#include "common/base/nameless_file.h"

namespace meshwright {
absl::StatusOr<std::shared_ptr<void>> MapScratch(size_t bytes, const std::string& beside) {
  if (bytes == 0) return nullptr;
  MW_ASSIGN_OR_RETURN(const int descriptor, CreateNamelessFile(beside));
  // Room is taken now: a mapped page that finds none later would end the process.
  const int full = ::posix_fallocate(descriptor, 0, static_cast<off_t>(bytes));
  void* mapped = full != 0 ? MAP_FAILED : ::mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_SHARED, descriptor, 0);
  const int error = full != 0 ? full : errno;
  ::close(descriptor);
  if (mapped == MAP_FAILED) return NamelessFileError("map", beside, error);
  return std::shared_ptr<void>(mapped, [bytes](void* at) { ::munmap(at, bytes); });
}

}  // namespace meshwright
