// SPDX-License-Identifier: Apache-2.0
#include "common/image/decode.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <optional>
#include <utility>

#include <absl/status/status.h>
#include <absl/strings/str_cat.h>

#include "common/base/files.h"
#include "common/base/mutex.h"
#include "common/base/status_macros.h"
#include "common/image/codecs.h"
#include "common/image/resize.h"

namespace meshwright {
namespace {

struct Codec {
  bool (*looks_like)(const std::string& bytes);
  absl::StatusOr<ImageSize> (*size)(const std::string& bytes);
  absl::StatusOr<ColorImage> (*decode)(const std::string& bytes);
  absl::Status (*decode_rows)(const std::string& bytes, int min_width, RowSink& sink);
};

constexpr Codec kCodecs[] = {{LooksLikeJpeg, JpegSize, DecodeJpeg, DecodeJpegRows},
                             {LooksLikePng, PngSize, DecodePng, DecodePngRows},
                             {LooksLikePnm, PnmSize, DecodePnm, DecodePnmRows}};

absl::Status Named(const std::string& name, const absl::Status& status) {
  return absl::Status(status.code(), absl::StrCat(name, ": ", std::string(status.message())));
}

absl::StatusOr<const Codec*> FindCodec(const std::string& bytes) {
  for (const Codec& codec : kCodecs) {
    if (codec.looks_like(bytes)) return &codec;
  }
  return absl::InvalidArgumentError(bytes.empty() ? "empty file; expected a JPEG, PNG or binary PGM/PPM picture"
                                                  : "not a JPEG, PNG or binary PGM/PPM picture");
}

absl::StatusOr<ImageSize> CheckedSize(const Codec& codec, const std::string& bytes) {
  MW_ASSIGN_OR_RETURN(const ImageSize size, codec.size(bytes));
  if (int64_t{size.width} * size.height > kMaxImagePixels) {
    return absl::InvalidArgumentError(absl::StrCat("header says ", size.width, " x ", size.height,
                                                   " px; expected at most ", kMaxImagePixels, " pixels"));
  }
  return size;
}

// A lying header must not make us allocate: no codec here packs more pixels than this into a byte.
absl::Status CheckPlausible(const ImageSize& size, size_t file_bytes) {
  constexpr int64_t kMaxPixelsPerByte = 10'000;
  if (int64_t{size.width} * size.height <= kMaxPixelsPerByte * static_cast<int64_t>(file_bytes)) {
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError(absl::StrCat("truncated or damaged: header says ", size.width, " x ", size.height,
                                                 " px out of ", file_bytes, " bytes"));
}

// A picture that may be decoded.
struct Recognized {
  const Codec* codec = nullptr;
  ImageSize size;
};

absl::StatusOr<Recognized> Recognize(const std::string& bytes) {
  Recognized picture;
  MW_ASSIGN_OR_RETURN(picture.codec, FindCodec(bytes));
  MW_ASSIGN_OR_RETURN(picture.size, CheckedSize(*picture.codec, bytes));
  MW_RETURN_IF_ERROR(CheckPlausible(picture.size, bytes.size()));
  return picture;
}

absl::StatusOr<ImageSize> SizeFromBytes(const std::string& bytes) {
  MW_ASSIGN_OR_RETURN(const Codec* codec, FindCodec(bytes));
  return CheckedSize(*codec, bytes);
}

// The system's words for a folder or a device in a picture's place would be strange ones.
absl::Status CheckRegularFile(const std::string& path) {
  std::error_code error;
  const std::filesystem::file_status status = std::filesystem::status(path, error);
  if (std::filesystem::exists(status) && !std::filesystem::is_regular_file(status)) {
    return absl::InvalidArgumentError(absl::StrCat(path, ": not a regular file; expected a picture"));
  }
  return absl::OkStatus();
}

// Reduces rows to `width` columns at most.
class ReducingSink final : public RowSink {
 public:
  explicit ReducingSink(int width) : width_(width) {}
  void Begin(ImageSize size) override {
    const int columns = std::min(width_, size.width);
    const auto rows = static_cast<int>(int64_t{size.height} * columns / size.width);
    reducer_.emplace(size.width, size.height, columns, std::max(1, rows));
  }
  void Row(const uint8_t* rgb) override { reducer_->AddRow(rgb); }
  ColorImage Take() { return reducer_->Take(); }

 private:
  const int width_;
  std::optional<AreaReducer> reducer_;
};

// Wants to know only that there is a row.
class ForgettingSink final : public RowSink {
 public:
  void Begin(ImageSize /*size*/) override {}
  void Row(const uint8_t* /*rgb*/) override {}
};

// Nobody makes a server keep many pictures, or take all of its cores, by asking for many at once.
Mutex& OneAtATime() {
  static Mutex mutex;
  return mutex;
}

}  // namespace

absl::StatusOr<ImageSize> ReadImageSize(const std::string& path) {
  MW_RETURN_IF_ERROR(CheckRegularFile(path));
  // Nearly always the header lies in the first bytes; metadata in front of it may push it further.
  std::string beginning(size_t{1} << 16, '\0');
  std::ifstream stream(path, std::ios::binary);
  if (stream.read(beginning.data(), static_cast<std::streamsize>(beginning.size()))) {
    absl::StatusOr<ImageSize> size = SizeFromBytes(beginning);
    if (size.ok()) return size;
  }
  MW_ASSIGN_OR_RETURN(const std::string bytes, ReadFile(path));
  absl::StatusOr<ImageSize> size = SizeFromBytes(bytes);
  if (!size.ok()) return Named(path, size.status());
  return size;
}

absl::StatusOr<ColorImage> DecodeImageBytes(const std::string& bytes, const std::string& name) {
  const auto decode = [&]() -> absl::StatusOr<ColorImage> {
    MW_ASSIGN_OR_RETURN(const Recognized picture, Recognize(bytes));
    return picture.codec->decode(bytes);
  };
  absl::StatusOr<ColorImage> image = decode();
  if (!image.ok()) return Named(name, image.status());
  return image;
}

absl::StatusOr<ImageSize> CheckImageBytes(const std::string& bytes, const std::string& name) {
  const auto check = [&]() -> absl::StatusOr<ImageSize> {
    MW_ASSIGN_OR_RETURN(const Recognized picture, Recognize(bytes));
    ForgettingSink sink;
    const absl::Status by_rows = picture.codec->decode_rows(bytes, 1, sink);
    if (!by_rows.ok()) {
      // Damaged, or too large to be read by rows: decoding it whole tells.
      const MutexLock lock(OneAtATime());
      MW_RETURN_IF_ERROR(picture.codec->decode(bytes).status());
    }
    return picture.size;
  };
  absl::StatusOr<ImageSize> size = check();
  if (!size.ok()) return Named(name, size.status());
  return size;
}

absl::StatusOr<ColorImage> DecodeReduced(const std::string& bytes, const std::string& name, int width) {
  const auto decode = [&]() -> absl::StatusOr<ColorImage> {
    MW_ASSIGN_OR_RETURN(const Recognized picture, Recognize(bytes));
    const MutexLock lock(OneAtATime());
    ReducingSink sink(width);
    MW_RETURN_IF_ERROR(picture.codec->decode_rows(bytes, width, sink));
    return sink.Take();
  };
  absl::StatusOr<ColorImage> image = decode();
  if (!image.ok()) return Named(name, image.status());
  return image;
}

}  // namespace meshwright
