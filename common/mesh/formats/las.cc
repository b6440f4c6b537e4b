// SPDX-License-Identifier: Apache-2.0
#include "common/mesh/formats/las.h"

#include <cmath>
#include <limits>

#include <absl/strings/str_cat.h>

#include "common/mesh/formats/row_writer.h"

namespace meshwright {
namespace {

constexpr uint16_t kHeaderBytes = 227;
constexpr uint8_t kPointFormat = 2;  // with colours
constexpr uint16_t kPointBytes = 26;
constexpr uint8_t kOnlyReturn = 0b001'001;  // return 1 of 1
constexpr uint16_t kColorScale = 257;       // 255 -> 65535

// How coordinates become whole numbers.
struct Grid {
  Eigen::Vector3d offset;
  double scale = 1;

  int32_t Number(double coordinate, int axis) const {
    return static_cast<int32_t>(std::llround((coordinate - offset[axis]) / scale));
  }
};

// Of all vertices, as they are in the world.
struct WorldBounds {
  Eigen::Vector3d low;
  Eigen::Vector3d high;
};

WorldBounds BoundsOf(const MeshRows& mesh) {
  const MeshRows::Bounds bounds = mesh.FindBounds();
  return {bounds.low.cast<double>() + mesh.offset(), bounds.high.cast<double>() + mesh.offset()};
}

Grid GridOf(const WorldBounds& bounds) {
  const Eigen::Vector3d centre = 0.5 * (bounds.low + bounds.high);
  const double extent = std::max((bounds.high - bounds.low).maxCoeff(), std::numeric_limits<float>::min() * 1.0);
  // Numbers of at most half an extent from the centre, and of the centre's rounding, have to fit into 31 bits.
  Grid grid;
  grid.scale = std::pow(10.0, std::ceil(std::log10(extent / (1 << 30))));
  const double rounding = 1000 * grid.scale;
  for (int k = 0; k < 3; ++k) grid.offset[k] = std::round(centre[k] / rounding) * rounding;
  return grid;
}

void AppendText(const char* text, size_t size, std::string& bytes) {
  std::string field = text;
  field.resize(size, '\0');
  bytes += field;
}

// Public header block; dates stay 0, so that the same mesh gives the same bytes.
std::string Header(size_t points, const WorldBounds& bounds, const Grid& grid) {
  std::string header = "LASF";
  AppendLittleEndian(uint16_t{0}, header);  // file source
  AppendLittleEndian(uint16_t{0}, header);  // global encoding
  header.append(16, '\0');                  // project
  header += '\1';                           // version 1.2
  header += '\2';
  AppendText("", 32, header);  // system
  AppendText("Meshwright", 32, header);
  AppendLittleEndian(uint16_t{0}, header);  // day of year
  AppendLittleEndian(uint16_t{0}, header);  // year
  AppendLittleEndian(kHeaderBytes, header);
  AppendLittleEndian(uint32_t{kHeaderBytes}, header);  // where points begin
  AppendLittleEndian(uint32_t{0}, header);             // variable length records
  AppendLittleEndian(kPointFormat, header);
  AppendLittleEndian(kPointBytes, header);
  AppendLittleEndian(static_cast<uint32_t>(points), header);
  AppendLittleEndian(static_cast<uint32_t>(points), header);  // by return: all are first ones
  for (int i = 0; i < 4; ++i) AppendLittleEndian(uint32_t{0}, header);
  for (int k = 0; k < 3; ++k) AppendLittleEndian(grid.scale, header);
  for (int k = 0; k < 3; ++k) AppendLittleEndian(grid.offset[k], header);
  for (int k = 0; k < 3; ++k) {
    // Of what is stored, which is rounded.
    AppendLittleEndian(grid.Number(bounds.high[k], k) * grid.scale + grid.offset[k], header);
    AppendLittleEndian(grid.Number(bounds.low[k], k) * grid.scale + grid.offset[k], header);
  }
  return header;
}

void AppendPoint(const MeshRows& mesh, const Grid& grid, size_t vertex, std::string& bytes) {
  const Eigen::Vector3d x = mesh.WorldPosition(vertex);
  for (int k = 0; k < 3; ++k) AppendLittleEndian(grid.Number(x[k], k), bytes);
  AppendLittleEndian(uint16_t{0}, bytes);  // intensity
  AppendLittleEndian(kOnlyReturn, bytes);
  AppendLittleEndian(uint8_t{0}, bytes);   // never classified
  AppendLittleEndian(uint8_t{0}, bytes);   // scan angle
  AppendLittleEndian(uint8_t{0}, bytes);   // user data
  AppendLittleEndian(uint16_t{0}, bytes);  // source
  const std::array<uint8_t, 3> color = mesh.has_colors() ? mesh.Color(vertex) : std::array<uint8_t, 3>{};
  for (const uint8_t channel : color) AppendLittleEndian(static_cast<uint16_t>(channel * kColorScale), bytes);
}

}  // namespace

absl::Status WriteLas(const MeshRows& mesh, const std::string& path) {
  constexpr size_t kMost = std::numeric_limits<uint32_t>::max();
  if (mesh.vertices() == 0) {
    return absl::InvalidArgumentError(absl::StrCat(path, ": the mesh has 0 vertices, LAS expects at least 1"));
  }
  if (mesh.vertices() > kMost) {
    return absl::OutOfRangeError(
        absl::StrCat(path, ": the mesh has ", mesh.vertices(), " vertices, expected at most ", kMost, " in LAS 1.2"));
  }
  const WorldBounds bounds = BoundsOf(mesh);
  const Grid grid = GridOf(bounds);
  MW_ASSIGN_OR_RETURN(AtomicFile file, AtomicFile::Create(path));
  MW_RETURN_IF_ERROR(file.Append(Header(mesh.vertices(), bounds, grid)));
  MW_RETURN_IF_ERROR(AppendRows(
      mesh.vertices(), [&](size_t vertex, std::string& bytes) { AppendPoint(mesh, grid, vertex, bytes); }, file));
  return file.Commit();
}

}  // namespace meshwright
