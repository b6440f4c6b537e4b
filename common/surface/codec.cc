// SPDX-License-Identifier: Apache-2.0
#include "common/surface/codec.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <utility>
#include <vector>

#include <absl/status/status.h>
#include <absl/strings/escaping.h>
#include <absl/strings/str_cat.h>
#include <zlib.h>

#include "common/base/check.h"
#include "common/base/little_endian.h"
#include "common/base/status_macros.h"
#include "common/geometry/camera_bounds.h"

namespace meshwright {
namespace {

// docs/formats/surface.md draws these.
constexpr char kMagic[] = {'M', 'W', 'S', 'F'};
constexpr uint32_t kVersion = 1;
constexpr size_t kHeaderBytes = 192;
constexpr size_t kRunBytes = 8;
constexpr size_t kPatchBytes = 24;
constexpr size_t kChecksumBytes = 4;
// Larger lattices are refused, so that bytes from outside cannot ask for any amount of memory.
constexpr int64_t kMostNodes = int64_t{1} << 28;

constexpr float kLongestNormal = 1.01F;
constexpr float kLargestQuality = 1e6F;

// Nodes first .. first + length - 1 have a patch; the ones before and behind have none.
struct Run {
  uint32_t first = 0;
  uint32_t length = 0;
};

std::vector<Run> FindRuns(const SparseSurface& surface) {
  std::vector<Run> runs;
  for (const int32_t node : surface.node) {
    const auto at = static_cast<uint32_t>(node);
    if (runs.empty() || runs.back().first + runs.back().length != at) runs.push_back({at, 0});
    ++runs.back().length;
  }
  return runs;
}

uint32_t Checksum(const char* bytes, size_t size) {
  uLong crc = ::crc32(0, nullptr, 0);
  while (size > 0) {
    const size_t piece = std::min<size_t>(size, 1 << 30);
    crc = ::crc32(crc, reinterpret_cast<const Bytef*>(bytes), static_cast<uInt>(piece));
    bytes += piece;
    size -= piece;
  }
  return static_cast<uint32_t>(crc);
}

// The numbers of a camera in the order of the format.
std::array<double, 16> CameraNumbers(const Camera& camera) {
  std::array<double, 16> numbers = {camera.fx, camera.fy, camera.cx, camera.cy};
  for (int i = 0; i < 9; ++i) numbers[4 + i] = camera.cam_from_world.rotation(i / 3, i % 3);
  for (int i = 0; i < 3; ++i) numbers[13 + i] = camera.cam_from_world.translation[i];
  return numbers;
}

Camera CameraFrom(int32_t width, int32_t height, const std::array<double, 16>& numbers) {
  Camera camera{width, height, numbers[0], numbers[1], numbers[2], numbers[3], {}};
  for (int i = 0; i < 9; ++i) camera.cam_from_world.rotation(i / 3, i % 3) = numbers[4 + i];
  for (int i = 0; i < 3; ++i) camera.cam_from_world.translation[i] = numbers[13 + i];
  return camera;
}

template <typename T>
char* StoreColumn(const T* values, size_t count, char* out) {
  if constexpr (std::endian::native == std::endian::little || sizeof(T) == 1) {
    std::memcpy(out, values, count * sizeof(T));
    out += count * sizeof(T);
  } else {
    for (size_t i = 0; i < count; ++i) out = StoreLittleEndian(values[i], out);
  }
  return out;
}

template <typename T>
const char* LoadColumn(const char* bytes, size_t count, T* values) {
  if constexpr (std::endian::native == std::endian::little || sizeof(T) == 1) {
    std::memcpy(values, bytes, count * sizeof(T));
  } else {
    for (size_t i = 0; i < count; ++i) values[i] = LoadLittleEndian<T>(bytes + i * sizeof(T));
  }
  return bytes + count * sizeof(T);
}

// Reads fields one behind the other; the caller has made sure that the bytes exist.
class Fields {
 public:
  explicit Fields(const char* bytes) : next_(bytes) {}

  template <typename T>
  T Next() {
    const T value = LoadLittleEndian<T>(next_);
    next_ += sizeof(T);
    return value;
  }

  const char* next() const { return next_; }

 private:
  const char* next_;
};

template <typename Value, typename Expected>
absl::Status Bad(const std::string& field, const Value& value, const Expected& expected) {
  return absl::DataLossError(absl::StrCat("surface: ", field, " is ", value, ", expected ", expected));
}

// Checks what can be known before any field is used. The file then is as its writer left it, short of malice.
absl::Status CheckFrame(const std::string& bytes) {
  if (bytes.size() < kHeaderBytes + kChecksumBytes) {
    return Bad("length", bytes.size(), absl::StrCat("at least ", kHeaderBytes + kChecksumBytes, " bytes"));
  }
  if (std::memcmp(bytes.data(), kMagic, sizeof(kMagic)) != 0) {
    return Bad("magic", absl::StrCat("\"", absl::CHexEscape(bytes.substr(0, sizeof(kMagic))), "\""), "\"MWSF\"");
  }
  Fields fields(bytes.data() + sizeof(kMagic));
  if (const auto version = fields.Next<uint32_t>(); version != kVersion) return Bad("version", version, kVersion);
  if (const auto length = fields.Next<uint64_t>(); length != bytes.size()) {
    return Bad("length in the header", length, absl::StrCat("the number of bytes, ", bytes.size()));
  }
  const size_t covered = bytes.size() - kChecksumBytes;
  const auto written = LoadLittleEndian<uint32_t>(bytes.data() + covered);
  const uint32_t computed = Checksum(bytes.data(), covered);
  if (written != computed) {
    return Bad("checksum", absl::StrCat(absl::Hex(written)), absl::StrCat(absl::Hex(computed), ", that of the bytes"));
  }
  return absl::OkStatus();
}

// The nodes of all runs, ascending.
absl::StatusOr<std::vector<int32_t>> LoadRuns(Fields& fields, uint64_t count, uint64_t patches, int64_t nodes) {
  std::vector<int32_t> node_of_patch;
  node_of_patch.reserve(patches);
  uint64_t next = 0;  // first node at which the next run may begin
  for (uint64_t i = 0; i < count; ++i) {
    const auto first = fields.Next<uint32_t>();
    const auto length = fields.Next<uint32_t>();
    const uint64_t end = uint64_t{first} + length;
    if (first < next || length == 0 || end > static_cast<uint64_t>(nodes)) {
      return Bad(absl::StrCat("run ", i), absl::StrCat(first, " + ", length),
                 absl::StrCat("nodes in ", next, "..", nodes - 1));
    }
    next = end + 1;
    if (node_of_patch.size() + length > patches) {
      return Bad("sum of the runs' lengths", node_of_patch.size() + length,
                 absl::StrCat("the number of patches, ", patches));
    }
    for (uint64_t node = first; node < end; ++node) node_of_patch.push_back(static_cast<int32_t>(node));
  }
  if (node_of_patch.size() != patches) {
    return Bad("sum of the runs' lengths", node_of_patch.size(), absl::StrCat("the number of patches, ", patches));
  }
  return node_of_patch;
}

// What the rest of the system relies on: depths that are depths, links between nodes that have a patch.
absl::Status CheckPatches(const SparseSurface& surface) {
  const int32_t columns = surface.lattice.columns;
  const size_t patches = surface.patches();
  size_t below = 0;  // the first patch at the node below or behind it
  for (size_t patch = 0; patch < patches; ++patch) {
    const int32_t node = surface.node[patch];
    if (!(surface.depth[patch] > kNearest && surface.depth[patch] < kFarthest)) {
      return Bad(absl::StrCat("depth of node ", node), surface.depth[patch],
                 absl::StrCat("a number in ", kNearest, "..", kFarthest));
    }
    // Normals are directions; bounded and finite is what averaging them needs.
    if (!(surface.normal_in_world[patch].cwiseAbs().maxCoeff() < kLongestNormal)) {
      return Bad(absl::StrCat("normal of node ", node), surface.normal_in_world[patch].cwiseAbs().maxCoeff(),
                 "a unit vector");
    }
    if (!(std::abs(surface.quality[patch]) <= kLargestQuality)) {
      return Bad(absl::StrCat("quality of node ", node), surface.quality[patch],
                 absl::StrCat("at most ", kLargestQuality));
    }
    while (below < patches && surface.node[below] < node + columns) ++below;
    const uint8_t links = surface.links[patch];
    const bool has_right = (node + 1) % columns != 0 && patch + 1 < patches && surface.node[patch + 1] == node + 1;
    const bool has_below = below < patches && surface.node[below] == node + columns;
    if ((links & ~(PatchLattice::kLinkRight | PatchLattice::kLinkDown)) != 0 ||
        ((links & PatchLattice::kLinkRight) != 0 && !has_right) ||
        ((links & PatchLattice::kLinkDown) != 0 && !has_below)) {
      return Bad(absl::StrCat("links of node ", node), static_cast<int>(links), "links to nodes with a patch");
    }
  }
  return absl::OkStatus();
}

}  // namespace

std::string EncodeSurface(const PatchLattice& surface) { return EncodeSurface(SparseSurface::From(surface)); }

std::string EncodeSurface(const SparseSurface& surface) {
  const Lattice& lattice = surface.lattice;
  const Lattice expected = Lattice::For(surface.camera, lattice.step);
  MW_CHECK(lattice.columns == expected.columns && lattice.rows == expected.rows && lattice.nodes() <= kMostNodes);
  const std::vector<Run> runs = FindRuns(surface);
  MW_CHECK(CheckPatches(surface).ok());  // a surface that could be written but not read would be noticed too late
  const size_t patches = surface.patches();

  std::string bytes(kHeaderBytes + runs.size() * kRunBytes + patches * kPatchBytes + kChecksumBytes, '\0');
  char* out = std::copy(std::begin(kMagic), std::end(kMagic), bytes.data());
  out = StoreLittleEndian(kVersion, out);
  out = StoreLittleEndian(uint64_t{bytes.size()}, out);
  for (const int32_t number : {surface.camera_index, surface.camera.width, surface.camera.height, lattice.step,
                               lattice.columns, lattice.rows}) {
    out = StoreLittleEndian(number, out);
  }
  out = StoreLittleEndian(uint64_t{runs.size()}, out);
  out = StoreLittleEndian(uint64_t{patches}, out);
  for (const double number : CameraNumbers(surface.camera)) out = StoreLittleEndian(number, out);
  out = StoreLittleEndian(uint64_t{0}, out);  // reserved
  MW_CHECK(out == bytes.data() + kHeaderBytes);
  for (const Run& run : runs) {
    out = StoreLittleEndian(run.first, out);
    out = StoreLittleEndian(run.length, out);
  }
  if (patches > 0) {
    out = StoreColumn(surface.depth.data(), patches, out);
    out = StoreColumn(surface.normal_in_world.front().data(), 3 * patches, out);
    out = StoreColumn(surface.quality.data(), patches, out);
    out = StoreColumn(surface.rgb.front().data(), 3 * patches, out);
    out = StoreColumn(surface.links.data(), patches, out);
  }
  StoreLittleEndian(Checksum(bytes.data(), bytes.size() - kChecksumBytes), out);
  return bytes;
}

absl::StatusOr<PatchLattice> DecodeSurface(const std::string& bytes) {
  MW_ASSIGN_OR_RETURN(const SparseSurface surface, DecodeSparseSurface(bytes));
  return surface.ToLattice();
}

absl::StatusOr<SparseSurface> DecodeSparseSurface(const std::string& bytes) {
  MW_RETURN_IF_ERROR(CheckFrame(bytes));
  Fields fields(bytes.data() + sizeof(kMagic) + sizeof(uint32_t) + sizeof(uint64_t));
  const auto camera_index = fields.Next<int32_t>();
  const auto width = fields.Next<int32_t>();
  const auto height = fields.Next<int32_t>();
  const auto step = fields.Next<int32_t>();
  const auto columns = fields.Next<int32_t>();
  const auto rows = fields.Next<int32_t>();
  const auto run_count = fields.Next<uint64_t>();
  const auto patches = fields.Next<uint64_t>();
  std::array<double, 16> numbers = {};
  for (double& number : numbers) {
    number = fields.Next<double>();
    if (!std::isfinite(number)) return Bad("a number of the camera", number, "a finite number");
  }
  fields.Next<uint64_t>();  // reserved

  if (width < 0 || height < 0) return Bad("image size", absl::StrCat(width, " x ", height), "no negative numbers");
  if (step < 1) return Bad("lattice step", step, "at least 1");
  const Camera camera = CameraFrom(width, height, numbers);
  if (patches > 0) {
    if (const absl::Status sound = CheckCamera(camera); !sound.ok()) {
      return absl::DataLossError(absl::StrCat("surface: ", sound.message()));
    }
  }
  const Lattice lattice = Lattice::For(camera, step);
  if (columns != lattice.columns || rows != lattice.rows || lattice.nodes() > kMostNodes) {
    return Bad("lattice", absl::StrCat(columns, " x ", rows),
               absl::StrCat(lattice.columns, " x ", lattice.rows, ", at most ", kMostNodes, " nodes"));
  }
  const uint64_t body = bytes.size() - kHeaderBytes - kChecksumBytes;
  if (run_count > body / kRunBytes || patches > body / kPatchBytes ||
      run_count * kRunBytes + patches * kPatchBytes != body) {
    return Bad("number of runs and patches", absl::StrCat(run_count, " and ", patches),
               absl::StrCat("as many as fill ", body, " bytes"));
  }
  SparseSurface surface{.camera_index = camera_index, .camera = camera, .lattice = lattice};
  MW_ASSIGN_OR_RETURN(surface.node, LoadRuns(fields, run_count, patches, lattice.nodes()));
  surface.depth.resize(patches);
  surface.normal_in_world.resize(patches);
  surface.quality.resize(patches);
  surface.rgb.resize(patches);
  surface.links.resize(patches);
  if (patches > 0) {
    const char* column = fields.next();
    column = LoadColumn(column, patches, surface.depth.data());
    column = LoadColumn(column, 3 * patches, surface.normal_in_world.front().data());
    column = LoadColumn(column, patches, surface.quality.data());
    column = LoadColumn(column, 3 * patches, surface.rgb.front().data());
    LoadColumn(column, patches, surface.links.data());
  }
  MW_RETURN_IF_ERROR(CheckPatches(surface));
  return surface;
}

}  // namespace meshwright
