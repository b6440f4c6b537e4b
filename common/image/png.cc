// SPDX-License-Identifier: Apache-2.0
#include <csetjmp>
#include <cstdio>
#include <cstring>
#include <vector>

#include <absl/status/status.h>
#include <absl/strings/str_cat.h>
#include <png.h>

#include "common/base/check.h"
#include "common/base/status_macros.h"
#include "common/image/codecs.h"
#include "common/image/encode.h"

namespace meshwright {
namespace {

// libpng reports errors through a callback that must not return: it leaves by longjmp, so the functions that set a jump
// own nothing that has a destructor.
struct ErrorState {
  std::jmp_buf jump = {};
  char message[256] = "";
};

[[noreturn]] void LeaveWithError(png_structp png, png_const_charp message) {
  auto* state = static_cast<ErrorState*>(png_get_error_ptr(png));
  std::snprintf(state->message, sizeof(state->message), "%s", message);
  std::longjmp(state->jump, 1);
}

// libpng warns of odd ancillary chunks only; pixels that cannot be trusted are errors.
void IgnoreWarning(png_structp, png_const_charp) {}

struct Source {
  const std::string* bytes = nullptr;
  size_t offset = 0;
};

void ReadFromSource(png_structp png, png_bytep out, size_t count) {
  auto* source = static_cast<Source*>(png_get_io_ptr(png));
  if (count > source->bytes->size() - source->offset) png_error(png, "the file ends early");
  std::memcpy(out, source->bytes->data() + source->offset, count);
  source->offset += count;
}

void AppendToString(png_structp png, png_bytep data, size_t count) {
  static_cast<std::string*>(png_get_io_ptr(png))->append(reinterpret_cast<const char*>(data), count);
}

void IgnoreFlush(png_structp) {}

bool ReadHeader(png_structp png, png_infop info, Source* source, ErrorState* errors, ImageSize* size) {
  if (setjmp(errors->jump) != 0) return false;
  png_set_read_fn(png, source, ReadFromSource);
  png_read_info(png, info);
  size->width = static_cast<int>(png_get_image_width(png, info));
  size->height = static_cast<int>(png_get_image_height(png, info));
  return true;
}

// To 8-bit RGB. Returns in how many passes over all rows. Leaves by png's jump.
int SetUpRgb(png_structp png, png_infop info) {
  png_set_expand(png);  // palettes to colours, 1, 2 and 4 bits to 8
  png_set_scale_16(png);
  png_set_gray_to_rgb(png);
  png_set_strip_alpha(png);
  const int passes = png_set_interlace_handling(png);
  png_read_update_info(png, info);
  if (png_get_rowbytes(png, info) != size_t{3} * png_get_image_width(png, info)) png_error(png, "unexpected row size");
  return passes;
}

bool ReadPixels(png_structp png, png_infop info, ErrorState* errors, ColorImage* image) {
  if (setjmp(errors->jump) != 0) return false;
  const int passes = SetUpRgb(png, info);
  image->width = static_cast<int>(png_get_image_width(png, info));
  image->height = static_cast<int>(png_get_image_height(png, info));
  const size_t row_bytes = size_t{3} * png_get_image_width(png, info);
  image->rgb.assign(row_bytes * png_get_image_height(png, info), 0);
  for (int pass = 0; pass < passes; ++pass) {
    for (int y = 0; y < image->height; ++y) {
      png_read_row(png, image->rgb.data() + row_bytes * static_cast<size_t>(y), nullptr);
    }
  }
  png_read_end(png, nullptr);
  return true;
}

// `row`: room for one.
bool ReadRows(png_structp png, png_infop info, ErrorState* errors, uint8_t* row, RowSink* sink) {
  if (setjmp(errors->jump) != 0) return false;
  SetUpRgb(png, info);
  const png_uint_32 height = png_get_image_height(png, info);
  sink->Begin({static_cast<int>(png_get_image_width(png, info)), static_cast<int>(height)});
  for (png_uint_32 y = 0; y < height; ++y) {
    png_read_row(png, row, nullptr);
    sink->Row(row);
  }
  png_read_end(png, nullptr);
  return true;
}

bool WritePixels(const ColorImage& image, png_structp png, png_infop info, ErrorState* errors, std::string* bytes) {
  if (setjmp(errors->jump) != 0) return false;
  png_set_write_fn(png, bytes, AppendToString, IgnoreFlush);
  png_set_IHDR(png, info, static_cast<png_uint_32>(image.width), static_cast<png_uint_32>(image.height), 8,
               PNG_COLOR_TYPE_RGB, PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
  png_write_info(png, info);
  const size_t row_bytes = size_t{3} * static_cast<size_t>(image.width);
  for (int y = 0; y < image.height; ++y) {
    png_write_row(png, image.rgb.data() + row_bytes * static_cast<size_t>(y));
  }
  png_write_end(png, nullptr);
  return true;
}

absl::Status Damaged(const ErrorState& errors) {
  return absl::InvalidArgumentError(
      absl::StrCat("truncated or damaged PNG (", errors.message, "); expected a whole picture"));
}

// `read(png, info, errors, size)` after the header; false when it has left with an error.
template <typename Read>
absl::Status Decode(const std::string& bytes, const Read& read) {
  ErrorState errors;
  Source source{.bytes = &bytes};
  ImageSize size;
  png_structp png = png_create_read_struct(PNG_LIBPNG_VER_STRING, &errors, LeaveWithError, IgnoreWarning);
  MW_CHECK(png != nullptr);
  png_infop info = png_create_info_struct(png);
  MW_CHECK(info != nullptr);
  const bool ok = ReadHeader(png, info, &source, &errors, &size) && read(png, info, &errors, size);
  png_destroy_read_struct(&png, &info, nullptr);
  return ok ? absl::OkStatus() : Damaged(errors);
}

}  // namespace

bool LooksLikePng(const std::string& bytes) { return bytes.compare(0, 8, "\x89PNG\r\n\x1a\n") == 0; }

absl::StatusOr<ImageSize> PngSize(const std::string& bytes) {
  // The size stands in the first chunk, at a fixed place.
  if (bytes.size() < 24 || bytes.compare(12, 4, "IHDR") != 0) {
    return absl::InvalidArgumentError("truncated or damaged PNG header; expected an IHDR chunk");
  }
  const auto big_endian = [&](size_t offset) {
    uint32_t value = 0;
    for (size_t i = 0; i < 4; ++i) value = (value << 8) | static_cast<uint8_t>(bytes[offset + i]);
    return value;
  };
  const uint32_t width = big_endian(16);
  const uint32_t height = big_endian(20);
  if (width == 0 || height == 0 || width > 0x7FFFFFFF || height > 0x7FFFFFFF) {
    return absl::InvalidArgumentError(absl::StrCat("PNG header says ", width, " x ", height, " px"));
  }
  return ImageSize{static_cast<int>(width), static_cast<int>(height)};
}

absl::StatusOr<ColorImage> DecodePng(const std::string& bytes) {
  ColorImage image;
  MW_RETURN_IF_ERROR(Decode(bytes, [&](png_structp png, png_infop info, ErrorState* errors, ImageSize) {
    return ReadPixels(png, info, errors, &image);
  }));
  return image;
}

absl::Status DecodePngRows(const std::string& bytes, int, RowSink& sink) {
  // The rows of an interlaced one are whole at the end only.
  constexpr size_t kInterlaceAt = 28;
  if (bytes.size() > kInterlaceAt && bytes[kInterlaceAt] != 0) {
    MW_ASSIGN_OR_RETURN(const ImageSize size, PngSize(bytes));
    if (int64_t{3} * size.width * size.height > kMaxKeptBytes) {
      return absl::InvalidArgumentError(
          absl::StrCat("interlaced PNG of ", size.width, " x ", size.height, " px; expected fewer, or no interlacing"));
    }
    MW_ASSIGN_OR_RETURN(const ColorImage image, DecodePng(bytes));
    sink.Begin({image.width, image.height});
    const size_t row_bytes = 3 * static_cast<size_t>(image.width);
    for (size_t y = 0; y < static_cast<size_t>(image.height); ++y) sink.Row(image.rgb.data() + y * row_bytes);
    return absl::OkStatus();
  }
  std::vector<uint8_t> row;
  return Decode(bytes, [&](png_structp png, png_infop info, ErrorState* errors, ImageSize size) {
    row.resize(3 * static_cast<size_t>(size.width));
    return ReadRows(png, info, errors, row.data(), &sink);
  });
}

std::string EncodePng(const ColorImage& image) {
  MW_CHECK(image.width >= 1 && image.height >= 1);
  MW_CHECK(image.rgb.size() == size_t{3} * static_cast<size_t>(image.width) * static_cast<size_t>(image.height));
  ErrorState errors;
  std::string bytes;
  png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, &errors, LeaveWithError, IgnoreWarning);
  MW_CHECK(png != nullptr);
  png_infop info = png_create_info_struct(png);
  MW_CHECK(info != nullptr);
  const bool ok = WritePixels(image, png, info, &errors, &bytes);
  png_destroy_write_struct(&png, &info);
  MW_CHECK(ok);  // memory in, memory out: nothing from outside can go wrong
  return bytes;
}

}  // namespace meshwright
