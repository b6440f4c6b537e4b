// SPDX-License-Identifier: Apache-2.0
#include "coordinator/incidence/incidence_matrix.h"

#include <algorithm>
#include <cstdint>

#include "common/base/check.h"

namespace meshwright {
namespace {

void Insert(std::vector<CameraIndex>& row, CameraIndex column) {
  const auto place = std::lower_bound(row.begin(), row.end(), column);
  if (place == row.end() || *place != column) row.insert(place, column);
}

void Erase(std::vector<CameraIndex>& row, CameraIndex column) {
  const auto place = std::lower_bound(row.begin(), row.end(), column);
  if (place != row.end() && *place == column) row.erase(place);
}

}  // namespace

bool IncidenceMatrix::Get(CameraIndex row, CameraIndex column) const {
  const std::vector<CameraIndex>& columns = Neighbours(row);
  return std::binary_search(columns.begin(), columns.end(), column);
}

void IncidenceMatrix::Set(CameraIndex i, CameraIndex j) {
  MW_CHECK(i != j && i >= 0 && j >= 0 && i < cameras() && j < cameras());
  Insert(rows_[static_cast<size_t>(i)], j);
  Insert(rows_[static_cast<size_t>(j)], i);
}

void IncidenceMatrix::Clear(CameraIndex i, CameraIndex j) {
  MW_CHECK(i >= 0 && j >= 0 && i < cameras() && j < cameras());
  Erase(rows_[static_cast<size_t>(i)], j);
  Erase(rows_[static_cast<size_t>(j)], i);
}

void IncidenceMatrix::ClearRow(CameraIndex row) {
  MW_CHECK(row >= 0 && row < cameras());
  rows_[static_cast<size_t>(row)].clear();
}

int64_t IncidenceMatrix::CountBits() const {
  int64_t bits = 0;
  for (const std::vector<CameraIndex>& row : rows_) bits += static_cast<int64_t>(row.size());
  return bits;
}

}  // namespace meshwright
