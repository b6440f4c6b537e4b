// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include <absl/status/statusor.h>

#include "common/image/color_image.h"
#include "common/image/decode.h"

// The decoders behind decode.h, one a format. Errors are InvalidArgument and say what is wrong; the caller puts the
// file's name in front. The *Size functions read the header only and accept the beginning of a file.
namespace meshwright {

// Where the rows of a picture go, from the top. Nothing of it throws: decoders leave by longjmp.
class RowSink {
 public:
  virtual ~RowSink() = default;
  // Before the first row. Rows may come smaller than the picture is: a JPEG's by 1/2, 1/4 or 1/8.
  virtual void Begin(ImageSize size) = 0;
  virtual void Row(const uint8_t* rgb) = 0;
};

// Pictures that their format makes one keep whole while they are decoded to rows: what they may take.
constexpr int64_t kMaxKeptBytes = int64_t{48} << 20;

bool LooksLikeJpeg(const std::string& bytes);
absl::StatusOr<ImageSize> JpegSize(const std::string& bytes);
absl::StatusOr<ColorImage> DecodeJpeg(const std::string& bytes);
// Not smaller than `min_width` columns, unless the picture is.
absl::Status DecodeJpegRows(const std::string& bytes, int min_width, RowSink& sink);

bool LooksLikePng(const std::string& bytes);
absl::StatusOr<ImageSize> PngSize(const std::string& bytes);
absl::StatusOr<ColorImage> DecodePng(const std::string& bytes);
absl::Status DecodePngRows(const std::string& bytes, int min_width, RowSink& sink);

// Binary PGM (P5) and PPM (P6).
bool LooksLikePnm(const std::string& bytes);
absl::StatusOr<ImageSize> PnmSize(const std::string& bytes);
absl::StatusOr<ColorImage> DecodePnm(const std::string& bytes);
// Keeps it whole: it is hardly larger than the bytes are.
absl::Status DecodePnmRows(const std::string& bytes, int min_width, RowSink& sink);

}  // namespace meshwright
