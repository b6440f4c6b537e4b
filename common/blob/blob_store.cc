// SPDX-License-Identifier: Apache-2.0
#include "common/blob/blob_store.h"

#include <algorithm>
#include <filesystem>
#include <system_error>

#include <absl/strings/escaping.h>
#include <absl/strings/str_cat.h>

#include "common/base/files.h"
#include "common/base/status_macros.h"

namespace meshwright {

absl::StatusOr<std::string> BlobStore::PutFile(const std::string& path) {
  MW_ASSIGN_OR_RETURN(const std::string bytes, ReadFile(path));
  return Put(bytes);
}

absl::Status BlobStore::GetFile(const std::string& digest, const std::string& path) {
  MW_ASSIGN_OR_RETURN(const std::string bytes, Get(digest));
  return WriteFileAtomically(path, bytes);
}

absl::Status BlobStore::Adopt(const std::string& path, const std::string& digest) {
  MW_ASSIGN_OR_RETURN(const std::string put, PutFile(path));
  if (put != digest) return absl::AbortedError(absl::StrCat(path, ": it has digest ", put, ", expected ", digest));
  std::error_code error;
  std::filesystem::remove(path, error);
  return absl::OkStatus();
}

absl::Status ValidateDigest(const std::string& digest, const std::string& name) {
  constexpr size_t kDigits = 64;
  const bool valid = digest.size() == kDigits && std::all_of(digest.begin(), digest.end(), [](char c) {
                       return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'f');
                     });
  if (valid) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat(name, " is \"", absl::CHexEscape(digest.substr(0, 2 * kDigits)),
                                                 "\", expected 64 lower-case hexadecimal digits"));
}

}  // namespace meshwright
