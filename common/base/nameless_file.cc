// SPDX-License-Identifier: Apache-2.0
#include "common/base/nameless_file.h"

#include <cerrno>
#include <cstdlib>
#include <cstring>

#include <absl/strings/str_cat.h>
#include <fcntl.h>
#include <unistd.h>

namespace meshwright {

absl::StatusOr<int> CreateNamelessFile(const std::string& path) {
  std::string name = path + ".scratch-XXXXXX";
  const int descriptor = ::mkostemp(name.data(), O_CLOEXEC);
  if (descriptor < 0) return NamelessFileError("create", path, errno);
  ::unlink(name.c_str());
  return descriptor;
}

absl::Status NamelessFileError(const std::string& what, const std::string& path, int error) {
  const std::string message =
      absl::StrCat(path, ": cannot ", what, " a temporary file beside it: ", std::strerror(error));
  if (error == ENOSPC || error == EDQUOT) return absl::ResourceExhaustedError(message);
  return absl::InternalError(message);
}

}  // namespace meshwright
