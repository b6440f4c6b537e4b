// SPDX-License-Identifier: Apache-2.0
#include "coordinator/auth/token_text.h"

#include <algorithm>
#include <array>

#include <absl/strings/escaping.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/string_view.h>
#include <openssl/crypto.h>
#include <openssl/rand.h>

#include "common/base/check.h"

namespace meshwright {
namespace {

constexpr absl::string_view kPrefix = "mwt_";
constexpr size_t kIdDigits = 16;
constexpr size_t kSecretDigits = 64;

std::string RandomDigits(size_t digits) {
  std::array<unsigned char, kSecretDigits / 2> bytes{};
  MW_CHECK(RAND_bytes(bytes.data(), static_cast<int>(digits / 2)) == 1);
  return absl::BytesToHexString(absl::string_view(reinterpret_cast<const char*>(bytes.data()), digits / 2));
}

bool IsHexadecimal(const std::string& text) { return text.find_first_not_of("0123456789abcdef") == std::string::npos; }

}  // namespace

std::string TokenText::Text() const { return absl::StrCat(kPrefix, id, "_", secret); }

TokenText NewToken() { return {.id = RandomDigits(kIdDigits), .secret = RandomDigits(kSecretDigits)}; }

std::optional<TokenText> ParseToken(const std::string& text) {
  if (text.size() != kPrefix.size() + kIdDigits + 1 + kSecretDigits || text.compare(0, 4, "mwt_") != 0) {
    return std::nullopt;
  }
  TokenText token = {.id = text.substr(kPrefix.size(), kIdDigits), .secret = text.substr(text.size() - kSecretDigits)};
  if (text[kPrefix.size() + kIdDigits] != '_' || !IsHexadecimal(token.id) || !IsHexadecimal(token.secret)) {
    return std::nullopt;
  }
  return token;
}

bool EqualInConstantTime(const std::string& a, const std::string& b) {
  return a.size() == b.size() && CRYPTO_memcmp(a.data(), b.data(), a.size()) == 0;
}

}  // namespace meshwright
