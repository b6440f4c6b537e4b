// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cctype>

#include <absl/status/status.h>
#include <absl/strings/str_cat.h>

#include "common/base/status_macros.h"
#include "common/image/codecs.h"

namespace meshwright {
namespace {

struct Header {
  ImageSize size;
  int channels = 0;
  int max_value = 0;
  size_t pixels_offset = 0;
};

// One decimal number of the header, after white space and comments.
absl::StatusOr<int> ReadNumber(const std::string& bytes, size_t* offset) {
  while (*offset < bytes.size()) {
    const auto c = static_cast<unsigned char>(bytes[*offset]);
    if (c == '#') {
      while (*offset < bytes.size() && bytes[*offset] != '\n') ++*offset;
    } else if (std::isspace(c) != 0) {
      ++*offset;
    } else {
      break;
    }
  }
  int value = 0;
  int digits = 0;
  for (; *offset < bytes.size() && std::isdigit(static_cast<unsigned char>(bytes[*offset])) != 0; ++*offset) {
    value = 10 * value + (bytes[*offset] - '0');
    if (++digits > 8) break;
  }
  if (digits == 0 || digits > 8) {
    return absl::InvalidArgumentError("damaged PGM/PPM header; expected width, height and largest value");
  }
  return value;
}

absl::StatusOr<Header> ReadHeader(const std::string& bytes) {
  Header header;
  header.channels = bytes[1] == '6' ? 3 : 1;
  size_t offset = 2;
  MW_ASSIGN_OR_RETURN(header.size.width, ReadNumber(bytes, &offset));
  MW_ASSIGN_OR_RETURN(header.size.height, ReadNumber(bytes, &offset));
  MW_ASSIGN_OR_RETURN(header.max_value, ReadNumber(bytes, &offset));
  header.pixels_offset = offset + 1;  // exactly one white space ends the header
  if (header.size.width < 1 || header.size.height < 1 || header.max_value < 1 || header.max_value > 65535) {
    return absl::InvalidArgumentError(absl::StrCat("PGM/PPM header says ", header.size.width, " x ", header.size.height,
                                                   " px, largest value ", header.max_value,
                                                   "; expected positive sizes and a value of 1 to 65535"));
  }
  return header;
}

}  // namespace

bool LooksLikePnm(const std::string& bytes) {
  return bytes.size() >= 3 && bytes[0] == 'P' && (bytes[1] == '5' || bytes[1] == '6') &&
         std::isspace(static_cast<unsigned char>(bytes[2])) != 0;
}

absl::StatusOr<ImageSize> PnmSize(const std::string& bytes) {
  MW_ASSIGN_OR_RETURN(const Header header, ReadHeader(bytes));
  return header.size;
}

absl::StatusOr<ColorImage> DecodePnm(const std::string& bytes) {
  MW_ASSIGN_OR_RETURN(const Header header, ReadHeader(bytes));
  const size_t pixels = static_cast<size_t>(header.size.width) * static_cast<size_t>(header.size.height);
  const auto channels = static_cast<size_t>(header.channels);
  const size_t sample_bytes = header.max_value > 255 ? 2 : 1;
  const size_t expected = header.pixels_offset + pixels * channels * sample_bytes;
  if (bytes.size() < expected) {
    return absl::InvalidArgumentError(absl::StrCat("truncated PGM/PPM: ", bytes.size(), " bytes; expected ", expected));
  }
  const auto* data = reinterpret_cast<const uint8_t*>(bytes.data()) + header.pixels_offset;
  const auto max_value = static_cast<uint32_t>(header.max_value);
  ColorImage image{.width = header.size.width, .height = header.size.height, .rgb = {}};
  image.rgb.resize(3 * pixels);
  for (size_t i = 0; i < pixels; ++i) {
    for (size_t c = 0; c < 3; ++c) {
      const uint8_t* sample = data + (i * channels + (channels == 3 ? c : 0)) * sample_bytes;
      const uint32_t value = sample_bytes == 2 ? (uint32_t{sample[0]} << 8) | sample[1] : sample[0];
      image.rgb[3 * i + c] = static_cast<uint8_t>((std::min(value, max_value) * 255 + max_value / 2) / max_value);
    }
  }
  return image;
}

absl::Status DecodePnmRows(const std::string& bytes, int, RowSink& sink) {
  MW_ASSIGN_OR_RETURN(const ColorImage image, DecodePnm(bytes));
  sink.Begin({image.width, image.height});
  for (int row = 0; row < image.height; ++row) {
    sink.Row(image.rgb.data() + 3 * static_cast<size_t>(row) * static_cast<size_t>(image.width));
  }
  return absl::OkStatus();
}

}  // namespace meshwright
