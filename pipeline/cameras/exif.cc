// SPDX-License-Identifier: Apache-2.0
#include "pipeline/cameras/exif.h"

#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "common/base/little_endian.h"

namespace meshwright {
namespace {

constexpr uint16_t kMake = 0x010F;
constexpr uint16_t kModel = 0x0110;
constexpr uint16_t kExifFolder = 0x8769;
constexpr uint16_t kFocalLength = 0x920A;
constexpr uint16_t kFocalLengthIn35mm = 0xA405;
constexpr uint16_t kLensModel = 0xA434;

constexpr uint16_t kAscii = 2;
constexpr uint16_t kShort = 3;
constexpr uint16_t kRational = 5;

// The TIFF structure inside an EXIF block. Reads beyond its end give 0.
class Tiff {
 public:
  explicit Tiff(const std::string& bytes)
      : bytes_(bytes), order_(bytes.compare(0, 2, "MM") == 0 ? std::endian::big : std::endian::little) {}

  bool IsValid() const { return (order_ == std::endian::big || bytes_.compare(0, 2, "II") == 0) && U16(2) == 42; }

  uint16_t U16(size_t at) const { return Load<uint16_t>(at); }
  uint32_t U32(size_t at) const { return Load<uint32_t>(at); }

  std::string Text(size_t entry) const {
    const size_t count = U32(entry + 4);
    if (U16(entry + 2) != kAscii || count > kLongestText) return "";
    const size_t at = count <= 4 ? entry + 8 : U32(entry + 8);
    if (at < kHeaderBytes || at >= bytes_.size()) return "";  // cut before the entry ends, it reads as 0
    std::string text = bytes_.substr(at, count).c_str();      // up to its 0
    while (!text.empty() && text.back() == ' ') text.pop_back();
    return text;
  }

  double Number(size_t entry) const {
    if (U16(entry + 2) == kShort) return U16(entry + 8);
    if (U16(entry + 2) != kRational) return 0;
    const size_t at = U32(entry + 8);
    const double value = static_cast<double>(U32(at)) / U32(at + 4);
    return std::isfinite(value) ? value : 0;
  }

 private:
  static constexpr size_t kLongestText = 256;
  static constexpr size_t kHeaderBytes = 8;

  template <typename T>
  T Load(size_t at) const {
    if (at > bytes_.size() || sizeof(T) > bytes_.size() - at) return 0;
    return LoadScalar<T>(bytes_.data() + at, order_);
  }

  const std::string& bytes_;
  const std::endian order_;
};

void ReadEntry(const Tiff& tiff, size_t entry, ExifCamera* camera, size_t* exif_folder) {
  switch (tiff.U16(entry)) {
    case kMake:
      camera->make = tiff.Text(entry);
      break;
    case kModel:
      camera->model = tiff.Text(entry);
      break;
    case kLensModel:
      camera->lens = tiff.Text(entry);
      break;
    case kFocalLength:
      camera->focal_mm = tiff.Number(entry);
      break;
    case kFocalLengthIn35mm:
      camera->focal_35mm = tiff.Number(entry);
      break;
    case kExifFolder:
      *exif_folder = tiff.U32(entry + 8);
      break;
    default:
      break;
  }
}

// Returns where the folder of EXIF's own entries is; 0: not named in this one.
size_t ReadFolder(const Tiff& tiff, size_t at, ExifCamera* camera) {
  constexpr size_t kEntryBytes = 12;
  size_t exif_folder = 0;
  for (size_t i = 0; i < tiff.U16(at); ++i) ReadEntry(tiff, at + 2 + i * kEntryBytes, camera, &exif_folder);
  return exif_folder;
}

// The EXIF block's TIFF bytes; empty when there is none before the picture's data.
std::string FindTiff(const std::string& jpeg) {
  const auto byte = [&](size_t at) { return static_cast<uint8_t>(jpeg[at]); };
  size_t at = 2;
  while (at + 4 <= jpeg.size() && byte(at) == 0xFF) {
    const uint8_t marker = byte(at + 1);
    const size_t length = size_t{byte(at + 2)} << 8 | byte(at + 3);
    if (marker == 0xDA || length < 2) return "";
    if (marker == 0xE1 && jpeg.compare(at + 4, 6, std::string("Exif\0\0", 6)) == 0 && length > 8) {
      return jpeg.substr(at + 10, length - 8);
    }
    at += 2 + length;
  }
  return "";
}

}  // namespace

ExifCamera ReadExifCamera(const std::string& jpeg_beginning) {
  ExifCamera camera;
  if (jpeg_beginning.compare(0, 2, "\xFF\xD8") != 0) return camera;
  const std::string bytes = FindTiff(jpeg_beginning);
  const Tiff tiff(bytes);
  if (!tiff.IsValid()) return camera;
  if (const size_t exif_folder = ReadFolder(tiff, tiff.U32(4), &camera); exif_folder != 0) {
    ReadFolder(tiff, exif_folder, &camera);
  }
  return camera;
}

}  // namespace meshwright
