// SPDX-License-Identifier: Apache-2.0
#include <csetjmp>
#include <cstdio>
#include <cstdlib>

#include <absl/status/status.h>
#include <absl/strings/str_cat.h>
// jpeglib.h needs <cstdio> before it.
#include <jerror.h>
#include <jpeglib.h>

#include "common/base/check.h"
#include "common/base/status_macros.h"
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

// A scan of a progressive JPEG goes over the whole picture and may be a few bytes: files of kilobytes could ask for
// minutes. Cameras and programs write ten or so.
constexpr int kMaxScans = 100;
constexpr int64_t kMaxScannedPixels = int64_t{1} << 32;

void CheckScans(j_common_ptr info) {
  const auto* const decompress = reinterpret_cast<const jpeg_decompress_struct*>(info);
  const int64_t pixels = int64_t{decompress->image_width} * decompress->image_height;
  const int scans = decompress->input_scan_number;
  if (scans <= 1 || (scans <= kMaxScans && scans * pixels <= kMaxScannedPixels)) return;
  auto* manager = reinterpret_cast<ErrorManager*>(info->err);
  std::snprintf(manager->message, sizeof(manager->message), "more than %d scans of %u x %u pixels", scans - 1,
                decompress->image_width, decompress->image_height);
  std::longjmp(manager->jump, 1);
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

bool ReadRows(jpeg_decompress_struct* info, ErrorManager* errors, int min_width, RowSink* sink) {
  if (setjmp(errors->jump) != 0) return false;
  info->out_color_space = JCS_RGB;
  info->dct_method = JDCT_ISLOW;
  info->mem->max_memory_to_use = kMaxKeptBytes;
  info->scale_denom = 8;
  for (; info->scale_denom > 1; info->scale_denom /= 2) {
    info->scale_num = 1;
    jpeg_calc_output_dimensions(info);
    if (static_cast<int>(info->output_width) >= min_width) break;
  }
  jpeg_start_decompress(info);
  sink->Begin({static_cast<int>(info->output_width), static_cast<int>(info->output_height)});
  JSAMPARRAY rows =
      info->mem->alloc_sarray(reinterpret_cast<j_common_ptr>(info), JPOOL_IMAGE, 3 * info->output_width, 1);
  while (info->output_scanline < info->output_height) {
    if (jpeg_read_scanlines(info, rows, 1) == 1) sink->Row(rows[0]);
  }
  jpeg_finish_decompress(info);
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

// `read(info, errors)` after the header; false when it has left with an error.
template <typename Read>
absl::Status Decode(const std::string& bytes, const Read& read) {
  ErrorManager errors{};
  jpeg_decompress_struct info{};
  info.err = &errors.first;
  SetUpErrors(&errors);
  jpeg_progress_mgr progress{};
  progress.progress_monitor = CheckScans;
  ImageSize size;
  bool ok = ReadHeader(bytes, &info, &errors, &size);
  info.progress = &progress;
  const bool four_channels = ok && info.num_components == 4;
  ok = ok && !four_channels && read(&info, &errors);
  jpeg_destroy_decompress(&info);
  if (four_channels) return absl::InvalidArgumentError("CMYK JPEG; expected grey or RGB colour");
  if (!ok && errors.first.msg_code == JERR_NO_BACKING_STORE) {
    return absl::InvalidArgumentError(absl::StrCat("progressive JPEG of ", size.width, " x ", size.height,
                                                   " px; expected fewer, or a baseline JPEG"));
  }
  return ok ? absl::OkStatus() : Damaged(errors);
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
  ColorImage image;
  MW_RETURN_IF_ERROR(Decode(
      bytes, [&](jpeg_decompress_struct* info, ErrorManager* errors) { return ReadPixels(info, errors, &image); }));
  return image;
}

absl::Status DecodeJpegRows(const std::string& bytes, int min_width, RowSink& sink) {
  return Decode(bytes, [&](jpeg_decompress_struct* info, ErrorManager* errors) {
    return ReadRows(info, errors, min_width, &sink);
  });
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
