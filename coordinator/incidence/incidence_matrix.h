// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "common/base/ids.h"

namespace meshwright {

// The camera incidence matrix CI of section 3.2 (Jancosek et al. 2009): bit (i, j) says that cameras i and j form a
// feasible pair. Kept as sorted neighbour lists, so memory and every operation follow the number of pairs, not N^2.
// Pairs are set and cleared symmetrically. ClearRow empties one row and leaves its column: that is how a processed
// camera is marked, which stays useful as a target of the others.
class IncidenceMatrix {
 public:
  explicit IncidenceMatrix(int cameras = 0) : rows_(static_cast<size_t>(cameras)) {}

  int cameras() const { return static_cast<int>(rows_.size()); }
  bool Get(CameraIndex row, CameraIndex column) const;
  void Set(CameraIndex i, CameraIndex j);    // bits (i, j) and (j, i); i != j
  void Clear(CameraIndex i, CameraIndex j);  // bits (i, j) and (j, i)
  void ClearRow(CameraIndex row);

  int RowSum(CameraIndex row) const { return static_cast<int>(Neighbours(row).size()); }
  // O_r: the cameras whose bit is set in row r, ascending.
  const std::vector<CameraIndex>& Neighbours(CameraIndex row) const { return rows_[static_cast<size_t>(row)]; }
  int64_t CountBits() const;

  friend bool operator==(const IncidenceMatrix& a, const IncidenceMatrix& b) { return a.rows_ == b.rows_; }

 private:
  std::vector<std::vector<CameraIndex>> rows_;
};

}  // namespace meshwright
