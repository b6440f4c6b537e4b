// SPDX-License-Identifier: Apache-2.0
#include "pipeline/texturing/texture_options.h"

#include <absl/strings/str_cat.h>

namespace meshwright {
namespace {

template <typename Number>
absl::Status CheckRange(const char* name, Number value, Number least, Number most) {
  if (value >= least && value <= most) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat(name, " is ", value, ", expected ", least, "..", most));
}

}  // namespace

absl::Status TextureOptions::Validate() const {
  for (const absl::Status& status :
       {CheckRange("max-image-size", max_image_size, 0, 1 << 20), CheckRange("texture-error", max_error, 0.0, 100.0),
        CheckRange("texture-size", max_page_size, 256, 16384), CheckRange("seam-cost", seam_cost, 0.0, 100.0),
        CheckRange("jpeg-quality", jpeg_quality, 1, 100)}) {
    if (!status.ok()) return status;
  }
  return absl::OkStatus();
}

}  // namespace meshwright
