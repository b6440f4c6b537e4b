// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstring>
#include <string>
#include <type_traits>

namespace meshwright {

// Scalars as the bytes that files and wires carry, whatever the machine's own order.

// Reads a T from sizeof(T) bytes in byte order `order`; `bytes` need not be aligned.
template <typename T>
T LoadScalar(const char* bytes, std::endian order) {
  static_assert(std::is_arithmetic_v<T>);
  char copy[sizeof(T)];
  std::memcpy(copy, bytes, sizeof(T));
  if (order != std::endian::native) std::reverse(copy, copy + sizeof(T));
  T value;
  std::memcpy(&value, copy, sizeof(T));
  return value;
}

template <typename T>
T LoadLittleEndian(const char* bytes) {
  return LoadScalar<T>(bytes, std::endian::little);
}

// Writes the bytes of `value` to `out`, least significant first, and returns the place behind them.
template <typename T>
char* StoreLittleEndian(T value, char* out) {
  static_assert(std::is_arithmetic_v<T>);
  std::memcpy(out, &value, sizeof(T));
  if constexpr (std::endian::native != std::endian::little) std::reverse(out, out + sizeof(T));
  return out + sizeof(T);
}

template <typename T>
void AppendLittleEndian(T value, std::string& out) {
  char bytes[sizeof(T)];
  StoreLittleEndian(value, bytes);
  out.append(bytes, sizeof(T));
}

}  // namespace meshwright
