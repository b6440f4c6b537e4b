#include <csetjmp>
#include <cstdio>
#include <cstdlib>

#include <absl/status/status.h>
#include <absl/strings/str_cat.h>
// jpeglib.h needs <cstdio> before it.
#include <jerror.h>
#include <jpeglib.h>

#include "common/base/check.h"
#include "common/image/codecs.h"
#include "common/image/encode.h"

namespace meshwright {
namespace {

// libjpeg reports through callbacks: errors leave by longjmp, so the functions that set a jump own nothing that has a
// destructor. `first` must be the first member: libjpeg knows only that part.
struct ErrorManager {
  jpeg_error_mgr first;
  std::jmp_buf jump;
  char message[JMSG_LENGTH_MAX];
};

void LeaveWithError(j_common_ptr info) {
  auto* manager = reinterpret_cast<ErrorManager*>(info->err);
  manager->first.format_message(info, manager->message);
  std::longjmp(manager->jump, 1);
}

// libjpeg only warns of data that end early or do not decode, and goes on with grey: here that is an error. Warnings
// about headers (of scans too) and about padding before a marker, which some cameras write, are harmless.
void HandleMessage(j_common_ptr info, int level) {
  if (level >= 0) return;
  const int code = info->err->msg_code;
  if (code == JWRN_EXTRANEOUS_DATA || code == JWRN_ADOBE_XFORM || code == JWRN_JFIF_MAJOR ||
      code == JWRN_NOT_SEQUENTIAL || code == JWRN_BOGUS_PROGRESSION) {
    return;
  }
  LeaveWithError(info);
}

void SetUpErrors(ErrorManager* manager) {
  jpeg_std_error(&manager->first);
  manager->first.error_exit = LeaveWithError;
  manager->first.emit_message = HandleMessage;
  manager->message[0] = '\0';
}

bool ReadHeader(const std::string& bytes, jpeg_decompress_struct* info, ErrorManager* errors, ImageSize* size) {
  if (setjmp(errors->jump) != 0) return false;
  jpeg_create_decompress(info);
  jpeg_mem_src(info, reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size());
  jpeg_read_header(info, TRUE);
  size->width = static_cast<int>(info->image_width);
  size->height = static_cast<int>(info->image_height);
  return true;
}

bool ReadPixels(jpeg_decompress_struct* info, ErrorManager* errors, ColorImage* image) {
  if (setjmp(errors->jump) != 0) return false;
  info->out_color_space = JCS_RGB;
  info->dct_method = JDCT_ISLOW;  // the one that gives the same pixels on every machine
  jpeg_start_decompress(info);
  image->width = static_cast<int>(info->output_width);
  image->height = static_cast<int>(info->output_height);
  image->rgb.resize(size_t{3} * info->output_width * info->output_height);
  while (info->output_scanline < info->output_height) {
    JSAMPROW row = image->rgb.data() + size_t{3} * info->output_width * info->output_scanline;
    jpeg_read_scanlines(info, &row, 1);
  }
  jpeg_finish_decompress(info);  // reads on to the end marker
  return true;
}

bool WritePixels(const ColorImage& image, int quality, jpeg_compress_struct* info, ErrorManager* errors,
                 unsigned char** buffer, unsigned long* size) {  // NOLINT(google-runtime-int): libjpeg's type
  if (setjmp(errors->jump) != 0) return false;
  jpeg_create_compress(info);
  jpeg_mem_dest(info, buffer, size);
  info->image_width = static_cast<JDIMENSION>(image.width);
  info->image_height = static_cast<JDIMENSION>(image.height);
  info->input_components = 3;
  info->in_color_space = JCS_RGB;
  jpeg_set_defaults(info);
  jpeg_set_quality(info, quality, TRUE);
  info->dct_method = JDCT_ISLOW;
  info->comp_info[0].h_samp_factor = 1;
  info->comp_info[0].v_samp_factor = 1;
  jpeg_start_compress(info, TRUE);
  while (info->next_scanline < info->image_height) {
    JSAMPROW row = const_cast<JSAMPROW>(image.rgb.data()) + size_t{3} * info->image_width * info->next_scanline;
    jpeg_write_scanlines(info, &row, 1);
  }
  jpeg_finish_compress(info);
  return true;
}

absl::Status Damaged(const ErrorManager& errors) {
  return absl::InvalidArgumentError(
      absl::StrCat("truncated or damaged JPEG (", errors.message, "); expected a whole picture"));
}

}  // namespace

bool LooksLikeJpeg(const std::string& bytes) { return bytes.compare(0, 3, "\xFF\xD8\xFF") == 0; }

absl::StatusOr<ImageSize> JpegSize(const std::string& bytes) {
  ErrorManager errors{};
  jpeg_decompress_struct info{};
  info.err = &errors.first;
  SetUpErrors(&errors);
  ImageSize size;
  const bool ok = ReadHeader(bytes, &info, &errors, &size);
  jpeg_destroy_decompress(&info);
  if (!ok) return Damaged(errors);
  return size;
}

absl::StatusOr<ColorImage> DecodeJpeg(const std::string& bytes) {
  ErrorManager errors{};
  jpeg_decompress_struct info{};
  info.err = &errors.first;
  SetUpErrors(&errors);
  ImageSize size;
  ColorImage image;
  bool ok = ReadHeader(bytes, &info, &errors, &size);
  const bool four_channels = ok && info.num_components == 4;
  ok = ok && !four_channels && ReadPixels(&info, &errors, &image);
  jpeg_destroy_decompress(&info);
  if (four_channels) return absl::InvalidArgumentError("CMYK JPEG; expected grey or RGB colour");
  if (!ok) return Damaged(errors);
  return image;
}

std::string EncodeJpeg(const ColorImage& image, int quality) {
  MW_CHECK(image.width >= 1 && image.height >= 1 && image.width <= 65500 && image.height <= 65500);
  MW_CHECK(image.rgb.size() == size_t{3} * static_cast<size_t>(image.width) * static_cast<size_t>(image.height));
  ErrorManager errors{};
  jpeg_compress_struct info{};
  info.err = &errors.first;
  SetUpErrors(&errors);
  unsigned char* buffer = nullptr;
  unsigned long size = 0;  // NOLINT(google-runtime-int): libjpeg's type
  const bool ok = WritePixels(image, quality, &info, &errors, &buffer, &size);
  jpeg_destroy_compress(&info);
  MW_CHECK(ok);  // memory in, memory out: nothing from outside can go wrong
  std::string bytes(reinterpret_cast<const char*>(buffer), size);
  std::free(buffer);
  return bytes;
}

}  // namespace meshwright
// SPDX-License-Identifier: Apache-2.0
