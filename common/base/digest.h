// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>

#include <absl/types/span.h>

namespace meshwright {

// SHA-256 of `bytes` as 64 lower-case hexadecimal digits.
std::string Sha256Hex(absl::Span<const uint8_t> bytes);
std::string Sha256Hex(const std::string& bytes);

// The same over data that comes in pieces. A copy goes on by itself: its digest can be had while this one takes more.
class Sha256Stream {
 public:
  Sha256Stream();
  Sha256Stream(const Sha256Stream& other);
  Sha256Stream(Sha256Stream&& other) noexcept;
  Sha256Stream& operator=(Sha256Stream other) noexcept;
  ~Sha256Stream();
  void Update(absl::Span<const uint8_t> bytes);
  // Ends the stream. Call once.
  std::string HexDigest();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace meshwright
