// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>

namespace meshwright {

// A key as its owner holds it: "mwt_ID_SECRET". The secret is 256 random bits in hexadecimal digits. What is stored is
// the id and the digest of the secret; a secret that long needs no salt and no slow digest.
struct TokenText {
  std::string id;      // 16 hexadecimal digits
  std::string secret;  // 64 hexadecimal digits

  std::string Text() const;
};

TokenText NewToken();
std::optional<TokenText> ParseToken(const std::string& text);

// Compares without telling by its time how much of the two is equal.
bool EqualInConstantTime(const std::string& a, const std::string& b);

}  // namespace meshwright
