// SPDX-License-Identifier: Apache-2.0
#include "common/image/decode.h"

#include <cstdio>
#include <random>
#include <string>
#include <vector>

#include <absl/strings/str_cat.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
// jpeglib.h needs <cstdio> before it.
#include <jpeglib.h>
#include <png.h>

#include "common/base/files.h"
#include "common/base/temporary_folder_testing.h"
#include "common/image/encode.h"
#include "common/image/resize.h"

namespace meshwright {
namespace {

using testing::HasSubstr;

// Smooth, with some noise: what a photograph is to a codec.
ColorImage Picture(int width, int height) {
  std::mt19937 generator(7);
  ColorImage image{.width = width, .height = height, .rgb = {}};
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const auto noise = static_cast<int>(generator() % 16);
      image.rgb.push_back(static_cast<uint8_t>((200 * x) / width + noise));
      image.rgb.push_back(static_cast<uint8_t>((200 * y) / height + noise));
      image.rgb.push_back(static_cast<uint8_t>(100 + noise));
    }
  }
  return image;
}

absl::StatusOr<ColorImage> DecodeFile(const std::string& path) { return DecodeImageBytes(*ReadFile(path), path); }

std::string TemporaryPath(const std::string& name) {
  static const TemporaryFolder folder;
  return folder / name;
}

// Baseline or progressive, colour or grey, with restart markers.
std::string OtherJpeg(const ColorImage& image, bool progressive, bool grey, unsigned restart_interval) {
  jpeg_compress_struct info{};
  jpeg_error_mgr errors{};
  info.err = jpeg_std_error(&errors);
  jpeg_create_compress(&info);
  unsigned char* buffer = nullptr;
  unsigned long size = 0;  // NOLINT(google-runtime-int): libjpeg's type
  jpeg_mem_dest(&info, &buffer, &size);
  info.image_width = static_cast<JDIMENSION>(image.width);
  info.image_height = static_cast<JDIMENSION>(image.height);
  info.input_components = grey ? 1 : 3;
  info.in_color_space = grey ? JCS_GRAYSCALE : JCS_RGB;
  jpeg_set_defaults(&info);
  if (progressive) jpeg_simple_progression(&info);
  info.restart_interval = restart_interval;
  jpeg_start_compress(&info, TRUE);
  std::vector<uint8_t> samples = grey ? ToGrey(image).grey : image.rgb;
  while (info.next_scanline < info.image_height) {
    JSAMPROW row =
        samples.data() + info.next_scanline * info.image_width * static_cast<unsigned>(info.input_components);
    jpeg_write_scanlines(&info, &row, 1);
  }
  jpeg_finish_compress(&info);
  std::string bytes(reinterpret_cast<const char*>(buffer), size);
  jpeg_destroy_compress(&info);
  free(buffer);
  return bytes;
}

// A PNG of any kind; `samples` are the file's own bytes, rows one after the other.
std::string OtherPng(int width, int height, int bit_depth, int color_type, int interlace,
                     const std::vector<uint8_t>& samples) {
  png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, nullptr, nullptr, nullptr);
  png_infop info = png_create_info_struct(png);
  std::string bytes;
  png_set_write_fn(
      png, &bytes,
      [](png_structp p, png_bytep data, size_t count) {
        static_cast<std::string*>(png_get_io_ptr(p))->append(reinterpret_cast<char*>(data), count);
      },
      [](png_structp) {});
  png_set_IHDR(png, info, static_cast<png_uint_32>(width), static_cast<png_uint_32>(height), bit_depth, color_type,
               interlace, PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
  const png_color palette[2] = {{10, 20, 30}, {200, 100, 50}};
  const png_byte alpha[2] = {0, 128};
  if (color_type == PNG_COLOR_TYPE_PALETTE) {
    png_set_PLTE(png, info, palette, 2);
    png_set_tRNS(png, info, alpha, 2, nullptr);
  }
  png_set_gAMA(png, info, 0.3);  // to be ignored
  png_write_info(png, info);
  std::vector<png_bytep> rows;
  const size_t row_bytes = samples.size() / static_cast<size_t>(height);
  std::vector<uint8_t> copy = samples;
  for (size_t y = 0; y < static_cast<size_t>(height); ++y) rows.push_back(copy.data() + y * row_bytes);
  png_write_image(png, rows.data());
  png_write_end(png, nullptr);
  png_destroy_write_struct(&png, &info);
  return bytes;
}

void ExpectNoPrefixDecodes(const std::string& bytes, size_t step) {
  ASSERT_TRUE(DecodeImageBytes(bytes, "whole").ok());
  for (size_t length = 0; length < bytes.size(); length += (length + 64 < bytes.size() && length > 64) ? step : 1) {
    const absl::StatusOr<ColorImage> image = DecodeImageBytes(bytes.substr(0, length), "cut.img");
    ASSERT_EQ(image.status().code(), absl::StatusCode::kInvalidArgument) << length << " of " << bytes.size();
    ASSERT_THAT(std::string(image.status().message()), HasSubstr("cut.img: "));
  }
}

TEST(DecodeImageBytes, PngRoundTripIsExact) {
  const std::string path = TemporaryPath("round.png");
  const ColorImage image = Picture(61, 43);
  ASSERT_TRUE(WritePng(path, image).ok());
  const absl::StatusOr<ColorImage> decoded = DecodeFile(path);
  ASSERT_TRUE(decoded.ok()) << decoded.status();
  EXPECT_EQ(decoded->width, 61);
  EXPECT_EQ(decoded->height, 43);
  EXPECT_EQ(decoded->rgb, image.rgb);
}

TEST(DecodeImageBytes, JpegRoundTripIsClose) {
  const std::string path = TemporaryPath("round.jpg");
  const ColorImage image = Picture(61, 43);
  ASSERT_TRUE(WriteFileAtomically(path, EncodeJpeg(image, 95)).ok());
  const absl::StatusOr<ColorImage> decoded = DecodeFile(path);
  ASSERT_TRUE(decoded.ok()) << decoded.status();
  ASSERT_EQ(decoded->rgb.size(), image.rgb.size());
  double sum = 0;
  for (size_t i = 0; i < image.rgb.size(); ++i) sum += std::abs(image.rgb[i] - decoded->rgb[i]);
  EXPECT_LT(sum / static_cast<double>(image.rgb.size()), 3);
}

TEST(DecodeImageBytes, OtherKindsOfPngBecomeRgb) {
  const auto decode = [](const std::string& bytes) { return DecodeImageBytes(bytes, "x.png").value().rgb; };
  using Bytes = std::vector<uint8_t>;
  EXPECT_EQ(decode(OtherPng(2, 1, 8, PNG_COLOR_TYPE_GRAY, 0, {7, 250})), (Bytes{7, 7, 7, 250, 250, 250}));
  EXPECT_EQ(decode(OtherPng(2, 1, 1, PNG_COLOR_TYPE_GRAY, 0, {0x40})), (Bytes{0, 0, 0, 255, 255, 255}));
  EXPECT_EQ(decode(OtherPng(1, 1, 8, PNG_COLOR_TYPE_GRAY_ALPHA, 0, {9, 3})), (Bytes{9, 9, 9}));
  EXPECT_EQ(decode(OtherPng(1, 1, 8, PNG_COLOR_TYPE_RGBA, 0, {1, 2, 3, 0})), (Bytes{1, 2, 3}));
  EXPECT_EQ(decode(OtherPng(2, 1, 8, PNG_COLOR_TYPE_PALETTE, 0, {1, 0})), (Bytes{200, 100, 50, 10, 20, 30}));
  // 16 bits: 0x8080 is 128 / 255 exactly; 0x00FF is 0.99 / 255.
  EXPECT_EQ(decode(OtherPng(1, 1, 16, PNG_COLOR_TYPE_RGB, 0, {0x80, 0x80, 0x00, 0xFF, 0xFF, 0xFF})),
            (Bytes{128, 1, 255}));
  const ColorImage image = Picture(19, 11);
  EXPECT_EQ(decode(OtherPng(19, 11, 8, PNG_COLOR_TYPE_RGB, PNG_INTERLACE_ADAM7, image.rgb)), image.rgb);
}

TEST(DecodeImageBytes, OtherKindsOfJpegBecomeRgb) {
  const ColorImage image = Picture(40, 30);
  const ColorImage grey = DecodeImageBytes(OtherJpeg(image, false, true, 0), "x").value();
  for (size_t i = 0; i < grey.rgb.size(); i += 3) EXPECT_EQ(grey.rgb[i], grey.rgb[i + 2]);
  EXPECT_EQ(DecodeImageBytes(OtherJpeg(image, true, false, 0), "x").value().rgb,
            DecodeImageBytes(OtherJpeg(image, false, false, 2), "x").value().rgb);
}

TEST(DecodeImageBytes, AJpegWhoseScanHeaderLibjpegOnlyWarnsOfIsRead) {
  const ColorImage image = Picture(40, 30);
  const std::string bytes = EncodeJpeg(image, 90);
  const size_t scan = bytes.find("\xFF\xDA");
  ASSERT_NE(scan, std::string::npos);
  const size_t spectral_end = scan + 5 + 2 * static_cast<size_t>(bytes[scan + 4]) + 1;
  ASSERT_EQ(bytes[spectral_end], 63);  // of 0..63, what sequential scans have
  std::string unusual = bytes;
  unusual[spectral_end] = 0;
  const absl::StatusOr<ColorImage> decoded = DecodeImageBytes(unusual, "x");
  ASSERT_TRUE(decoded.ok()) << decoded.status();
  EXPECT_EQ(decoded->rgb, DecodeImageBytes(bytes, "x").value().rgb);
}

TEST(DecodeImageBytes, PnmWithCommentsAndDepths) {
  EXPECT_EQ(DecodeImageBytes("P6\n# a comment\n1 1\n255\n\x01\x02\x03", "x").value().rgb,
            (std::vector<uint8_t>{1, 2, 3}));
  EXPECT_EQ(DecodeImageBytes(std::string("P5 1 1 65535\n\x80\x80", 15), "x").value().rgb,
            (std::vector<uint8_t>{128, 128, 128}));
  EXPECT_EQ(DecodeImageBytes("P5 2 1 1\n\x01\x01", "x").value().rgb, std::vector<uint8_t>(6, 255));
  EXPECT_FALSE(DecodeImageBytes("P6\n0 1\n255\n", "x").ok());
  EXPECT_FALSE(DecodeImageBytes("P6\n99999999 99999999\n255\n", "x").ok());
  EXPECT_FALSE(DecodeImageBytes("P6\n12345678901234567890 1\n255\n", "x").ok());
}

TEST(DecodeImageBytes, IgnoresExifOrientation) {
  // Orientation 6, "rotate by 90 degrees", in the smallest EXIF segment.
  const std::string exif(
      "\xFF\xE1\x00\x22"
      "Exif\0\0"
      "MM\0\x2A\0\0\0\x08"
      "\0\x01"
      "\x01\x12\0\x03\0\0\0\x01\0\x06\0\0"
      "\0\0\0\0",
      36);
  std::string bytes = EncodeJpeg(Picture(40, 30), 90);
  const std::vector<uint8_t> plain = DecodeImageBytes(bytes, "x").value().rgb;
  bytes.insert(2, exif);
  const ColorImage image = DecodeImageBytes(bytes, "x").value();
  EXPECT_EQ(image.width, 40);
  EXPECT_EQ(image.rgb, plain);
}

TEST(DecodeImageBytes, TruncationIsAnErrorWhereverItIs) {
  const ColorImage image = Picture(96, 80);
  ExpectNoPrefixDecodes(EncodePng(image), 97);
  ExpectNoPrefixDecodes(EncodeJpeg(image, 90), 13);
  ExpectNoPrefixDecodes(OtherJpeg(image, true, false, 0), 7);
  ExpectNoPrefixDecodes(OtherJpeg(image, false, false, 3), 7);
  ExpectNoPrefixDecodes(OtherJpeg(image, false, true, 0), 7);
  ExpectNoPrefixDecodes("P6 4 4 255\n" + std::string(48, 'x'), 1);
}

TEST(DecodeImageBytes, AMissingPieceInsideAJpegIsAnError) {
  const std::string bytes = EncodeJpeg(Picture(96, 80), 90);
  std::string holed = bytes;
  holed.erase(bytes.size() / 2, bytes.size() / 4);
  EXPECT_EQ(DecodeImageBytes(holed, "x").status().code(), absl::StatusCode::kInvalidArgument);
}

TEST(DecodeImageBytes, FlippedBytesNeverCrashAndPngNoticesThemInPixels) {
  const ColorImage image = Picture(32, 24);
  for (const std::string& bytes : {EncodePng(image), EncodeJpeg(image, 90), OtherJpeg(image, true, false, 0),
                                   "P6 4 4 255\n" + std::string(48, 'x')}) {
    for (size_t i = 0; i < bytes.size(); ++i) {
      std::string damaged = bytes;
      damaged[i] = static_cast<char>(damaged[i] ^ (1 << (i % 8)));
      const absl::StatusOr<ColorImage> decoded = DecodeImageBytes(damaged, "x");
      if (decoded.ok()) {
        ASSERT_EQ(decoded->rgb.size(), static_cast<size_t>(3 * decoded->width * decoded->height));
        if (bytes[1] == 'P') {
          EXPECT_EQ(decoded->rgb, image.rgb) << i;
        }
      }
    }
  }
}

TEST(DecodeImageBytes, HugePicturesAreRefusedFromTheHeader) {
  std::string png = EncodePng(Picture(8, 8));
  png.replace(16, 8, std::string("\0\1\0\0\0\1\0\0", 8));  // 65536 x 65536
  const absl::Status status = DecodeImageBytes(png, "huge.png").status();
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(status.message()), HasSubstr("huge.png: header says 65536 x 65536 px; expected at most"));
  EXPECT_FALSE(DecodeImageBytes("P5 60000 60000 255\n", "huge.pgm").ok());
  // Within the limit, but not out of so few bytes.
  png.replace(16, 8, std::string("\0\0\x40\0\0\0\x40\0", 8));
  EXPECT_THAT(std::string(DecodeImageBytes(png, "huge.png").status().message()), HasSubstr("16384 x 16384 px out of"));
}

// To check is to decode without keeping.
TEST(CheckImageBytes, TellsWhatDecodingTells) {
  const ColorImage image = Picture(40, 24);
  const std::vector<uint8_t> samples(image.rgb);
  int damaged = 0;
  for (const std::string& bytes :
       {EncodePng(image), EncodeJpeg(image, 90), OtherJpeg(image, true, false, 0), OtherJpeg(image, false, true, 3),
        OtherPng(40, 24, 8, PNG_COLOR_TYPE_RGB, PNG_INTERLACE_ADAM7, samples), "P6 4 4 255\n" + std::string(48, 'x')}) {
    for (size_t i = 0; i < 2 * bytes.size(); ++i) {
      std::string other = bytes;
      if (i < bytes.size()) {
        other[i] = static_cast<char>(other[i] ^ (1 << (i % 8)));
      } else {
        other.resize(i - bytes.size());
      }
      const absl::StatusOr<ColorImage> decoded = DecodeImageBytes(other, "x");
      const absl::StatusOr<ImageSize> checked = CheckImageBytes(other, "x");
      ASSERT_EQ(checked.status(), decoded.status()) << i;
      if (!decoded.ok()) {
        ++damaged;
        continue;
      }
      ASSERT_EQ(checked->width, decoded->width);
      ASSERT_EQ(checked->height, decoded->height);
    }
  }
  EXPECT_GT(damaged, 1000);
}

TEST(CheckImageBytes, WhatCannotBeReadByRowsMayBeLarge) {
  const ColorImage large = {.width = 5000, .height = 4000, .rgb = std::vector<uint8_t>(60'000'000, 200)};
  for (const std::string& bytes : {OtherJpeg(large, true, false, 0),
                                   OtherPng(5000, 4000, 8, PNG_COLOR_TYPE_RGB, PNG_INTERLACE_ADAM7, large.rgb)}) {
    const absl::StatusOr<ImageSize> checked = CheckImageBytes(bytes, "x");
    ASSERT_TRUE(checked.ok()) << checked.status();
    EXPECT_EQ(checked->width, 5000);
  }
}

TEST(DecodeReduced, IsTheMeanOverTheWholePicture) {
  const ColorImage image = Picture(500, 300);
  const std::vector<uint8_t> samples(image.rgb);
  for (const std::string& bytes :
       {EncodePng(image), OtherPng(500, 300, 8, PNG_COLOR_TYPE_RGB, PNG_INTERLACE_ADAM7, samples),
        absl::StrCat("P6 500 300 255\n", std::string(samples.begin(), samples.end()))}) {
    const absl::StatusOr<ColorImage> reduced = DecodeReduced(bytes, "x", 200);
    ASSERT_TRUE(reduced.ok()) << reduced.status();
    EXPECT_EQ(reduced->rgb, ReduceByArea(image, 200, 120).rgb);
    EXPECT_EQ(DecodeReduced(bytes, "x", 1000)->rgb, image.rgb);
  }
  // A JPEG may be made smaller while it is decoded: nearly the same.
  for (const bool progressive : {false, true}) {
    const std::string bytes = OtherJpeg(image, progressive, false, 0);
    const ColorImage whole = ReduceByArea(*DecodeImageBytes(bytes, "x"), 100, 60);
    const absl::StatusOr<ColorImage> reduced = DecodeReduced(bytes, "x", 100);
    ASSERT_TRUE(reduced.ok()) << reduced.status();
    ASSERT_EQ(std::pair(reduced->width, reduced->height), std::pair(100, 60));
    for (size_t i = 0; i < whole.rgb.size(); ++i) ASSERT_NEAR(reduced->rgb[i], whole.rgb[i], 6);
  }
}

TEST(DecodeReduced, WhatCannotBeReadByRowsMayNotBeLarge) {
  const ColorImage large = {.width = 5000, .height = 4000, .rgb = std::vector<uint8_t>(60'000'000, 200)};
  EXPECT_TRUE(DecodeReduced(OtherJpeg(large, false, false, 0), "x", 64).ok());
  const absl::Status jpeg = DecodeReduced(OtherJpeg(large, true, false, 0), "x.jpg", 64).status();
  EXPECT_THAT(std::string(jpeg.message()), HasSubstr("x.jpg: progressive JPEG of 5000 x 4000 px"));
  const std::string interlaced = OtherPng(5000, 4000, 8, PNG_COLOR_TYPE_RGB, PNG_INTERLACE_ADAM7, large.rgb);
  EXPECT_THAT(DecodeReduced(interlaced, "x.png", 64).status().ToString(), HasSubstr("interlaced PNG of 5000 x 4000"));
}

TEST(DecodeReduced, DamageIsAnErrorThere) {
  const std::string png = EncodePng(Picture(300, 200));
  const std::string jpeg = EncodeJpeg(Picture(300, 200), 90);
  for (const std::string& bytes : {png.substr(0, png.size() / 2), jpeg.substr(0, jpeg.size() / 2)}) {
    EXPECT_EQ(DecodeReduced(bytes, "cut.img", 64).status().code(), absl::StatusCode::kInvalidArgument);
  }
}

// A scan is some bytes that make the decoder go over the whole picture.
TEST(DecodeImageBytes, AJpegOfHundredsOfScansIsRefused) {
  std::string bytes = OtherJpeg(Picture(64, 64), /*progressive=*/true, /*grey=*/true, 0);
  // The first one, which says the same however often it comes.
  const size_t begin = bytes.find("\xFF\xDA");
  size_t end = begin + 2;
  while (bytes[end] != '\xFF' || bytes[end + 1] == '\0') ++end;
  const std::string scan = bytes.substr(begin, end - begin);
  std::string few = bytes;
  for (int i = 0; i < 20; ++i) few.insert(end, scan);
  EXPECT_EQ(DecodeImageBytes(few, "x.jpg")->rgb, DecodeImageBytes(bytes, "x.jpg")->rgb);
  for (int i = 0; i < 200; ++i) bytes.insert(end, scan);
  EXPECT_THAT(DecodeImageBytes(bytes, "x.jpg").status().ToString(), HasSubstr("scans of 64 x 64 pixels"));
  EXPECT_FALSE(DecodeReduced(bytes, "x.jpg", 16).ok());
}

TEST(DecodeImageBytes, SaysWhatIsWrongWithTheFile) {
  EXPECT_EQ(ReadImageSize(TemporaryPath("none.png")).status().code(), absl::StatusCode::kNotFound);
  EXPECT_EQ(ReadImageSize(testing::TempDir()).status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(DecodeImageBytes("", "x").status().code(), absl::StatusCode::kInvalidArgument);
  const std::string path = TemporaryPath("text.png");
  ASSERT_TRUE(WriteFileAtomically(path, std::string("this is no picture")).ok());
  const absl::Status status = DecodeFile(path).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(status.message()), HasSubstr("text.png: not a JPEG, PNG or binary PGM/PPM picture"));
}

TEST(ReadImageSize, AgreesWithDecoding) {
  const ColorImage image = Picture(300, 200);
  std::string late_header = EncodeJpeg(image, 90);
  for (int i = 0; i < 3; ++i)
    late_header.insert(2, "\xFF\xE5\xFF\xFE" + std::string(0xFFFC, 'm'));  // 192 KiB of metadata
  const std::string files[] = {EncodePng(image), EncodeJpeg(image, 90), late_header,
                               "P6 300 200 255\n" + std::string(180000, 'x')};
  for (const std::string& bytes : files) {
    const std::string path = TemporaryPath("size");
    ASSERT_TRUE(WriteFileAtomically(path, bytes).ok());
    const absl::StatusOr<ImageSize> size = ReadImageSize(path);
    ASSERT_TRUE(size.ok()) << size.status();
    EXPECT_EQ(size->width, 300);
    EXPECT_EQ(size->height, 200);
    ASSERT_TRUE(DecodeFile(path).ok());
  }
}

TEST(WritePng, UnwritablePlaceIsNamed) {
  const absl::Status status = WritePng("/nonexistent-folder/x.png", Picture(2, 2));
  EXPECT_FALSE(status.ok());
  EXPECT_THAT(std::string(status.message()), HasSubstr("/nonexistent-folder/x.png"));
}

}  // namespace
}  // namespace meshwright
