// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <charconv>
#include <string>

#include <Eigen/Core>

namespace meshwright::obj {

// " 0.25": the shortest digits that give back the same number, whatever the locale.
template <typename Number>
void AppendNumber(Number value, std::string& text) {
  char digits[32];
  const std::to_chars_result end = std::to_chars(digits, digits + sizeof(digits), value);
  text += ' ';
  text.append(digits, end.ptr);
}

// "v 1 2 3".
template <typename Vector>
void AppendNumbers(const char* keyword, const Vector& vector, std::string& text) {
  text += keyword;
  for (Eigen::Index k = 0; k < vector.size(); ++k) AppendNumber(vector[k], text);
}

// A vertex as it is in the world: text has room for all digits.
inline void AppendPosition(const Eigen::Vector3f& position, const Eigen::Vector3d& offset, std::string& text) {
  if (offset.isZero(0)) {
    AppendNumbers("v", position, text);
  } else {
    AppendNumbers("v", Eigen::Vector3d(position.cast<double>() + offset), text);
  }
}

}  // namespace meshwright::obj
