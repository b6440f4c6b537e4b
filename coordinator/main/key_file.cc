// SPDX-License-Identifier: Apache-2.0
#include "coordinator/main/key_file.h"

#include <filesystem>
#include <system_error>

#include "common/base/files.h"
#include "coordinator/auth/token_text.h"

namespace meshwright {
absl::Status MakeKeyFile(const std::string& path) {
  std::error_code error;
  if (std::filesystem::exists(path, error)) return absl::OkStatus();
  return WriteFileAtomically(path, NewToken().Text() + "\n");
}

}  // namespace meshwright
