// SPDX-License-Identifier: Apache-2.0
#include "common/image/encode.h"

#include "common/base/files.h"

namespace meshwright {

absl::Status WritePng(const std::string& path, const ColorImage& image) {
  return WriteFileAtomically(path, EncodePng(image));
}

}  // namespace meshwright
