// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>

#include <absl/status/statusor.h>

#include "common/image/color_image.h"

namespace meshwright {

// Pictures with more pixels than this are refused from their header, before anything is allocated.
constexpr int64_t kMaxImagePixels = 400'000'000;

struct ImageSize {
  int width = 0;   // px
  int height = 0;  // px
};

// Size that a picture's header tells, read without decoding it. Errors as for DecodeImageBytes, and NotFound.
absl::StatusOr<ImageSize> ReadImageSize(const std::string& path);

// Decodes a JPEG, PNG or binary PGM/PPM to 8-bit RGB: 16-bit samples are scaled down, grey is replicated, transparency
// is dropped, an EXIF orientation is ignored (cameras are calibrated on the pixels as they are stored), colour profiles
// and gamma likewise. A picture is decoded whole or not at all: data that end early or do not decode cleanly are an
// error, never filled with grey. Errors name the file: NotFound (no such file), InvalidArgument (not a picture, kind
// not supported, truncated, damaged, larger than kMaxImagePixels).
absl::StatusOr<ColorImage> DecodeImageBytes(const std::string& bytes, const std::string& name);

// The size of a picture that DecodeImageBytes would decode, found out by reading all of it, and otherwise its error. A
// few rows are kept, whatever the size; the few pictures that their format makes one keep whole come one at a time
// where they are large.
absl::StatusOr<ImageSize> CheckImageBytes(const std::string& bytes, const std::string& name);

// A picture, reduced to `width` columns and rows alike by the mean over the area of each pixel, unless it has fewer;
// for looking at. One at a time in a process, and a few rows of it are kept, whatever its size: InvalidArgument for
// those that their format makes one keep whole (progressive JPEG, interlaced PNG) where that takes more than some tens
// of MiB.
absl::StatusOr<ColorImage> DecodeReduced(const std::string& bytes, const std::string& name, int width);

}  // namespace meshwright
