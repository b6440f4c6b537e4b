// SPDX-License-Identifier: Apache-2.0
#include "common/base/digest.h"

#include <array>

#include <absl/strings/escaping.h>
#include <absl/strings/string_view.h>
#include <openssl/evp.h>

#include "common/base/check.h"

namespace meshwright {

struct Sha256Stream::State {
  EVP_MD_CTX* context = EVP_MD_CTX_new();
  ~State() { EVP_MD_CTX_free(context); }
};

Sha256Stream::Sha256Stream() : state_(std::make_unique<State>()) {
  MW_CHECK(EVP_DigestInit_ex(state_->context, EVP_sha256(), nullptr) == 1);
}

Sha256Stream::Sha256Stream(const Sha256Stream& other) : state_(std::make_unique<State>()) {
  MW_CHECK(EVP_MD_CTX_copy_ex(state_->context, other.state_->context) == 1);
}

Sha256Stream::Sha256Stream(Sha256Stream&& other) noexcept = default;

Sha256Stream& Sha256Stream::operator=(Sha256Stream other) noexcept {
  state_.swap(other.state_);
  return *this;
}

Sha256Stream::~Sha256Stream() = default;

void Sha256Stream::Update(absl::Span<const uint8_t> bytes) {
  MW_CHECK(EVP_DigestUpdate(state_->context, bytes.data(), bytes.size()) == 1);
}

std::string Sha256Stream::HexDigest() {
  std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
  unsigned int size = 0;
  MW_CHECK(EVP_DigestFinal_ex(state_->context, digest.data(), &size) == 1);
  return absl::BytesToHexString(absl::string_view(reinterpret_cast<const char*>(digest.data()), size));
}

std::string Sha256Hex(absl::Span<const uint8_t> bytes) {
  Sha256Stream stream;
  stream.Update(bytes);
  return stream.HexDigest();
}

std::string Sha256Hex(const std::string& bytes) {
  return Sha256Hex(absl::MakeConstSpan(reinterpret_cast<const uint8_t*>(bytes.data()), bytes.size()));
}

}  // namespace meshwright
