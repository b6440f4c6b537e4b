#pragma once

#include <string>

#include <absl/status/statusor.h>

#include "common/image/color_image.h"
#include "common/image/decode.h"

// The decoders behind decode.h, one a format. Errors are InvalidArgument and say what is wrong; the caller puts the
// file's name in front. The *Size functions read the header only and accept the beginning of a file.
namespace meshwright {

bool LooksLikeJpeg(const std::string& bytes);
absl::StatusOr<ImageSize> JpegSize(const std::string& bytes);
absl::StatusOr<ColorImage> DecodeJpeg(const std::string& bytes);

bool LooksLikePng(const std::string& bytes);
absl::StatusOr<ImageSize> PngSize(const std::string& bytes);
absl::StatusOr<ColorImage> DecodePng(const std::string& bytes);

// Binary PGM (P5) and PPM (P6).
bool LooksLikePnm(const std::string& bytes);
absl::StatusOr<ImageSize> PnmSize(const std::string& bytes);
absl::StatusOr<ColorImage> DecodePnm(const std::string& bytes);

}  // namespace meshwright
// SPDX-License-Identifier: Apache-2.0
