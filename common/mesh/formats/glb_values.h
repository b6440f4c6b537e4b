// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>

#include <Eigen/Core>

#include "common/base/little_endian.h"

namespace meshwright::glb {

// Linear values of 16 bits for sRGB (IEC 61966-2-1): what COLOR_0 wants.
inline std::array<uint16_t, 256> LinearFromSrgb() {
  std::array<uint16_t, 256> table = {};
  for (int i = 0; i < 256; ++i) {
    const double c = i / 255.0;
    const double linear = c <= 0.04045 ? c / 12.92 : std::pow((c + 0.055) / 1.055, 2.4);
    table[static_cast<size_t>(i)] = static_cast<uint16_t>(std::lround(65535 * linear));
  }
  return table;
}

// Red, green, blue, and an alpha that hides nothing: rows of 8 bytes, where glTF wants a multiple of 4.
inline void AppendLinearColor(const std::array<uint8_t, 3>& srgb, const std::array<uint16_t, 256>& linear_from_srgb,
                              std::string& bytes) {
  for (const uint8_t channel : srgb) AppendLittleEndian(linear_from_srgb[channel], bytes);
  AppendLittleEndian(std::numeric_limits<uint16_t>::max(), bytes);
}

// glTF wants unit normals; one that has no direction becomes any.
inline Eigen::Vector3f UnitOrAny(const Eigen::Vector3f& normal) {
  const float length = normal.norm();
  return length > 0 && std::isfinite(length) ? Eigen::Vector3f(normal / length) : Eigen::Vector3f::UnitZ();
}

}  // namespace meshwright::glb
