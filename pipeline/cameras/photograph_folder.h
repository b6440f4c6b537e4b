// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "pipeline/cameras/exif.h"

#include "common/base/thread_pool.h"
#include "common/image/decode.h"

namespace meshwright {

struct Photograph {
  std::string name;  // relative to the folder: "IMG_1.jpg", "left/IMG_1.jpg"
  std::string path;
  std::string mask_path;  // black pixels are not looked at; "": none
  ImageSize size;         // px, as stored; 0 x 0 before it was checked
  ExifCamera exif;
};

// A folder of photographs without cameras.
struct PhotographFolder {
  std::string path;
  std::vector<Photograph> photographs;  // in natural order: frame9 before frame10
  std::vector<std::string> notes;       // what was left out and why, a line each
  std::string digest;                   // of names, photographs and masks; empty before they were checked
};

// Lists JPEG, PNG and PGM/PPM below `path`, hidden files and the folder masks/ left out; nothing is decoded. Masks are
// masks/NAME.EXT.png, masks/NAME.png (COLMAP's and OpenMVS's ways) in the folder or beside one called images/.
// NotFound: no such folder. BadInput: fewer than three photographs; the message says what is there instead and how to
// convert it.
absl::StatusOr<PhotographFolder> ListPhotographs(const std::string& path);

// Decodes every photograph once, so that what a reconstruction will refuse is known before hours of matching, and fills
// in sizes, EXIF and digest. Photographs that do not decode, and masks of another size, are left out with a note.
// `checked(n)` is called after each photograph, one call at a time. BadInput: fewer than three remain.
absl::Status CheckPhotographs(PhotographFolder* folder, ThreadPool& pool, const std::function<void(int n)>& checked);

// Whether `path` is a folder with at least one photograph in it: worth asking where its cameras are.
bool HoldsPhotographs(const std::string& path);

}  // namespace meshwright
