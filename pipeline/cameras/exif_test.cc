// SPDX-License-Identifier: Apache-2.0
#include "pipeline/cameras/exif.h"

#include <cstdint>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace meshwright {
namespace {

// A JPEG's beginning with an EXIF block, in either order of bytes.
class ExifWriter {
 public:
  explicit ExifWriter(bool big_endian) : big_endian_(big_endian) {
    tiff_ = big_endian ? "MM" : "II";
    Put(42, 2);
    Put(8, 4);
    Put(3, 2);  // entries of the first folder
    constexpr uint32_t kTexts = 8 + 2 + 3 * 12 + 4;
    Entry(0x010F, 2, 6, kTexts);  // "Maker\0"
    Entry(0x0110, 2, 4, 0);       // "X 1\0", inside the entry
    tiff_.replace(tiff_.size() - 4, 4, std::string("X 1\0", 4));
    Entry(0x8769, 4, 1, kTexts + 6);
    Put(0, 4);
    tiff_ += std::string("Maker\0", 6);
    Put(2, 2);
    Entry(0x920A, 5, 1, kTexts + 6 + 2 + 2 * 12 + 4);  // 425/100
    Entry(0xA405, 3, 1, big_endian ? 26U << 16 : 26);
    Put(0, 4);
    Put(425, 4);
    Put(100, 4);
  }

  std::string Jpeg() const {
    std::string jpeg = "\xFF\xD8\xFF\xE1";
    const size_t length = tiff_.size() + 8;
    jpeg.push_back(static_cast<char>(length >> 8));
    jpeg.push_back(static_cast<char>(length & 0xFF));
    return jpeg + std::string("Exif\0\0", 6) + tiff_ + "\xFF\xDA";
  }

 private:
  void Put(uint32_t value, int size) {
    for (int i = 0; i < size; ++i) tiff_.push_back(static_cast<char>(value >> (8 * (big_endian_ ? size - 1 - i : i))));
  }
  void Entry(uint32_t tag, uint32_t type, uint32_t count, uint32_t value) {
    Put(tag, 2);
    Put(type, 2);
    Put(count, 4);
    Put(value, 4);
  }

  const bool big_endian_;
  std::string tiff_;
};

TEST(Exif, IsReadInBothOrdersOfBytes) {
  for (const bool big_endian : {false, true}) {
    const ExifCamera camera = ReadExifCamera(ExifWriter(big_endian).Jpeg());
    EXPECT_EQ(camera.make, "Maker");
    EXPECT_EQ(camera.model, "X 1");
    EXPECT_EQ(camera.lens, "");
    EXPECT_DOUBLE_EQ(camera.focal_mm, 4.25);
    EXPECT_DOUBLE_EQ(camera.focal_35mm, 26);
  }
}

TEST(Exif, CutOrChangedAnywhereReadsOnlyWhatIsThere) {
  for (const bool big_endian : {false, true}) {
    const std::string jpeg = ExifWriter(big_endian).Jpeg();
    for (size_t size = 0; size < jpeg.size(); ++size) {
      EXPECT_THAT(ReadExifCamera(jpeg.substr(0, size)).make, testing::AnyOf("", "M", "Ma", "Mak", "Make", "Maker"));
      std::string changed = jpeg;
      changed[size] = static_cast<char>(0xFF);
      EXPECT_LE(ReadExifCamera(changed).make.size(), 256U);
    }
  }
}

TEST(Exif, OtherFilesHaveNone) {
  EXPECT_EQ(ReadExifCamera(""), ExifCamera());
  EXPECT_EQ(ReadExifCamera("\x89PNG\r\n"), ExifCamera());
}

}  // namespace
}  // namespace meshwright
