#include "coordinator/incidence/incidence_matrix.h"

#include <algorithm>
#include <cstdint>

#include <absl/status/status.h>
#include <absl/strings/str_cat.h>

#include "common/base/check.h"

namespace meshwright {
namespace {

constexpr uint32_t kMagic = 0x4943574D;  // "MWCI"
constexpr uint32_t kVersion = 1;

void Insert(std::vector<CameraIndex>& row, CameraIndex column) {
  const auto place = std::lower_bound(row.begin(), row.end(), column);
  if (place == row.end() || *place != column) row.insert(place, column);
}

void Erase(std::vector<CameraIndex>& row, CameraIndex column) {
  const auto place = std::lower_bound(row.begin(), row.end(), column);
  if (place != row.end() && *place == column) row.erase(place);
}

void AppendU32(uint32_t value, std::string& bytes) {
  for (int shift = 0; shift < 32; shift += 8) bytes.push_back(static_cast<char>((value >> shift) & 0xFF));
}

// Takes integers from the front of untrusted bytes.
class Reader {
 public:
  explicit Reader(const std::string& bytes) : bytes_(bytes) {}
  size_t left() const { return (bytes_.size() - position_) / 4; }
  bool at_end() const { return position_ == bytes_.size(); }
  bool Take(uint32_t& value) {
    if (left() == 0) return false;
    value = 0;
    for (int shift = 0; shift < 32; shift += 8) {
      value |= static_cast<uint32_t>(static_cast<uint8_t>(bytes_[position_++])) << shift;
    }
    return true;
  }

 private:
  const std::string& bytes_;
  size_t position_ = 0;
};

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

std::string IncidenceMatrix::Serialize() const {
  std::string bytes;
  bytes.reserve(4 * (3 + rows_.size() + static_cast<size_t>(CountBits())));
  AppendU32(kMagic, bytes);
  AppendU32(kVersion, bytes);
  AppendU32(static_cast<uint32_t>(rows_.size()), bytes);
  for (const std::vector<CameraIndex>& row : rows_) {
    AppendU32(static_cast<uint32_t>(row.size()), bytes);
    for (const CameraIndex column : row) AppendU32(static_cast<uint32_t>(column), bytes);
  }
  return bytes;
}

absl::StatusOr<IncidenceMatrix> IncidenceMatrix::Deserialize(const std::string& bytes) {
  Reader reader(bytes);
  uint32_t magic = 0;
  uint32_t version = 0;
  uint32_t cameras = 0;
  if (!reader.Take(magic) || magic != kMagic) return absl::DataLossError("incidence matrix: no magic 'MWCI' in front");
  if (!reader.Take(version) || version != kVersion) {
    return absl::DataLossError(absl::StrCat("incidence matrix: version ", version, ", expected ", kVersion));
  }
  // Every row takes an integer at least, so the bytes themselves bound what is allocated.
  if (!reader.Take(cameras) || cameras > reader.left()) {
    return absl::DataLossError(absl::StrCat("incidence matrix: truncated, ", cameras, " rows announced"));
  }
  IncidenceMatrix matrix(static_cast<int>(cameras));
  for (uint32_t row = 0; row < cameras; ++row) {
    uint32_t sum = 0;
    if (!reader.Take(sum) || sum > reader.left()) {
      return absl::DataLossError(absl::StrCat("incidence matrix: truncated in row ", row));
    }
    std::vector<CameraIndex>& columns = matrix.rows_[row];
    columns.reserve(sum);
    for (uint32_t i = 0; i < sum; ++i) {
      uint32_t column = 0;
      reader.Take(column);
      const bool ascending = columns.empty() || column > static_cast<uint32_t>(columns.back());
      if (column >= cameras || column == row || !ascending) {
        return absl::DataLossError(absl::StrCat("incidence matrix: row ", row, " has column ", column, " of ", cameras,
                                                ", expected ascending columns other than the row"));
      }
      columns.push_back(static_cast<CameraIndex>(column));
    }
  }
  if (!reader.at_end()) return absl::DataLossError("incidence matrix: bytes left over at the end");
  return matrix;
}

}  // namespace meshwright
// SPDX-License-Identifier: Apache-2.0
