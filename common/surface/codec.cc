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

// Nodes first .. first + length - 1 have a patch; the ones before and behind have none.
struct Run {
  uint32_t first = 0;
  uint32_t length = 0;
};

std::vector<Run> FindRuns(const PatchLattice& surface) {
  std::vector<Run> runs;
  const auto nodes = static_cast<uint32_t>(surface.lattice.nodes());
  for (uint32_t node = 0; node < nodes;) {
    if (!surface.HasPatch(node)) {
      ++node;
      continue;
    }
    const uint32_t first = node;
    while (node < nodes && surface.HasPatch(node)) ++node;
    runs.push_back({first, node - first});
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

// `per_node` scalars T of each node, of which the format keeps those of nodes with a patch, run after run.
template <typename T>
char* StoreColumn(const T* values, size_t per_node, const std::vector<Run>& runs, char* out) {
  for (const Run& run : runs) {
    const T* first = values + run.first * per_node;
    const size_t count = run.length * per_node;
    if constexpr (std::endian::native == std::endian::little || sizeof(T) == 1) {
      std::memcpy(out, first, count * sizeof(T));
      out += count * sizeof(T);
    } else {
      for (size_t i = 0; i < count; ++i) out = StoreLittleEndian(first[i], out);
    }
  }
  return out;
}

template <typename T>
const char* LoadColumn(const char* bytes, size_t per_node, const std::vector<Run>& runs, T* values) {
  for (const Run& run : runs) {
    T* first = values + run.first * per_node;
    const size_t count = run.length * per_node;
    if constexpr (std::endian::native == std::endian::little || sizeof(T) == 1) {
      std::memcpy(first, bytes, count * sizeof(T));
    } else {
      for (size_t i = 0; i < count; ++i) first[i] = LoadLittleEndian<T>(bytes + i * sizeof(T));
    }
    bytes += count * sizeof(T);
  }
  return bytes;
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

absl::StatusOr<std::vector<Run>> LoadRuns(Fields& fields, uint64_t count, uint64_t patches, int64_t nodes) {
  std::vector<Run> runs(count);
  uint64_t total = 0;
  uint64_t next = 0;  // first node at which the next run may begin
  for (uint64_t i = 0; i < count; ++i) {
    runs[i].first = fields.Next<uint32_t>();
    runs[i].length = fields.Next<uint32_t>();
    const uint64_t end = uint64_t{runs[i].first} + runs[i].length;
    if (runs[i].first < next || runs[i].length == 0 || end > static_cast<uint64_t>(nodes)) {
      return Bad(absl::StrCat("run ", i), absl::StrCat(runs[i].first, " + ", runs[i].length),
                 absl::StrCat("nodes in ", next, "..", nodes - 1));
    }
    next = end + 1;
    total += runs[i].length;
  }
  if (total != patches) return Bad("sum of the runs' lengths", total, absl::StrCat("the number of patches, ", patches));
  return runs;
}

// What the rest of the system relies on: depths that are depths, links between nodes that have a patch.
absl::Status CheckPatches(const PatchLattice& surface, const std::vector<Run>& runs) {
  const auto columns = static_cast<uint32_t>(surface.lattice.columns);
  const auto nodes = static_cast<uint64_t>(surface.lattice.nodes());
  for (const Run& run : runs) {
    for (uint32_t node = run.first; node < run.first + run.length; ++node) {
      if (!(surface.depth[node] > 0) || std::isinf(surface.depth[node])) {
        return Bad(absl::StrCat("depth of node ", node), surface.depth[node], "a finite number above 0");
      }
      const uint8_t links = surface.links[node];
      const bool right = (links & PatchLattice::kLinkRight) != 0;
      const bool down = (links & PatchLattice::kLinkDown) != 0;
      if ((links & ~(PatchLattice::kLinkRight | PatchLattice::kLinkDown)) != 0 ||
          (right && ((node + 1) % columns == 0 || !surface.HasPatch(node + 1))) ||
          (down && (uint64_t{node} + columns >= nodes || !surface.HasPatch(node + columns)))) {
        return Bad(absl::StrCat("links of node ", node), static_cast<int>(links), "links to nodes with a patch");
      }
    }
  }
  return absl::OkStatus();
}

}  // namespace

std::string EncodeSurface(const PatchLattice& surface) {
  const Lattice& lattice = surface.lattice;
  const Lattice expected = Lattice::For(surface.camera, lattice.step);
  MW_CHECK(lattice.columns == expected.columns && lattice.rows == expected.rows && lattice.nodes() <= kMostNodes);
  const std::vector<Run> runs = FindRuns(surface);
  MW_CHECK(CheckPatches(surface, runs).ok());  // a surface that could be written but not read would be noticed too late
  uint64_t patches = 0;
  for (const Run& run : runs) patches += run.length;

  std::string bytes(kHeaderBytes + runs.size() * kRunBytes + patches * kPatchBytes + kChecksumBytes, '\0');
  char* out = std::copy(std::begin(kMagic), std::end(kMagic), bytes.data());
  out = StoreLittleEndian(kVersion, out);
  out = StoreLittleEndian(uint64_t{bytes.size()}, out);
  for (const int32_t number : {surface.camera_index, surface.camera.width, surface.camera.height, lattice.step,
                               lattice.columns, lattice.rows}) {
    out = StoreLittleEndian(number, out);
  }
  out = StoreLittleEndian(uint64_t{runs.size()}, out);
  out = StoreLittleEndian(patches, out);
  for (const double number : CameraNumbers(surface.camera)) out = StoreLittleEndian(number, out);
  out = StoreLittleEndian(uint64_t{0}, out);  // reserved
  MW_CHECK(out == bytes.data() + kHeaderBytes);
  for (const Run& run : runs) {
    out = StoreLittleEndian(run.first, out);
    out = StoreLittleEndian(run.length, out);
  }
  if (patches > 0) {
    out = StoreColumn(surface.depth.data(), 1, runs, out);
    out = StoreColumn(surface.normal_in_world.front().data(), 3, runs, out);
    out = StoreColumn(surface.quality.data(), 1, runs, out);
    out = StoreColumn(surface.rgb.front().data(), 3, runs, out);
    out = StoreColumn(surface.links.data(), 1, runs, out);
  }
  StoreLittleEndian(Checksum(bytes.data(), bytes.size() - kChecksumBytes), out);
  return bytes;
}

absl::StatusOr<PatchLattice> DecodeSurface(const std::string& bytes) {
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
  MW_ASSIGN_OR_RETURN(const std::vector<Run> runs, LoadRuns(fields, run_count, patches, lattice.nodes()));

  PatchLattice surface = PatchLattice::Empty(camera_index, camera, step);
  if (patches > 0) {
    const char* column = fields.next();
    column = LoadColumn(column, 1, runs, surface.depth.data());
    column = LoadColumn(column, 3, runs, surface.normal_in_world.front().data());
    column = LoadColumn(column, 1, runs, surface.quality.data());
    column = LoadColumn(column, 3, runs, surface.rgb.front().data());
    LoadColumn(column, 1, runs, surface.links.data());
  }
  MW_RETURN_IF_ERROR(CheckPatches(surface, runs));
  return surface;
}

}  // namespace meshwright
