#include "common/blob/blob_store.h"

#include <algorithm>

#include <absl/strings/escaping.h>
#include <absl/strings/str_cat.h>

namespace meshwright {

absl::Status ValidateDigest(const std::string& digest) {
  constexpr size_t kDigits = 64;
  const bool valid = digest.size() == kDigits && std::all_of(digest.begin(), digest.end(), [](char c) {
                       return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'f');
                     });
  if (valid) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat("blob digest is \"", absl::CHexEscape(digest.substr(0, 2 * kDigits)),
                                                 "\", expected 64 lower-case hexadecimal digits"));
}

}  // namespace meshwright
