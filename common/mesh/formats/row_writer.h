// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstdint>
#include <string>

#include <Eigen/Core>
#include <absl/status/status.h>

#include "common/base/files.h"
#include "common/base/little_endian.h"
#include "common/base/status_macros.h"

namespace meshwright {

// Appends rows 0 .. count - 1 to `file`, each as append(row, bytes) leaves it behind `bytes`, in pieces.
template <typename AppendRow>
absl::Status AppendRows(size_t count, const AppendRow& append, AtomicFile& file) {
  constexpr size_t kRowsAtOnce = 1 << 14;
  std::string bytes;
  for (size_t begin = 0; begin < count; begin += kRowsAtOnce) {
    bytes.clear();
    for (size_t row = begin; row < std::min(count, begin + kRowsAtOnce); ++row) append(row, bytes);
    MW_RETURN_IF_ERROR(file.Append(bytes));
  }
  return absl::OkStatus();
}

inline void AppendVector(const Eigen::Vector3f& vector, std::string& bytes) {
  for (int k = 0; k < 3; ++k) AppendLittleEndian(vector[k], bytes);
}

}  // namespace meshwright
