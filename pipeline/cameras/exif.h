// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

namespace meshwright {

// What a photograph tells of the camera that took it. Empty or 0: it does not say.
struct ExifCamera {
  std::string make;
  std::string model;
  std::string lens;
  double focal_mm = 0;
  double focal_35mm = 0;  // of a lens with the same diagonal field of view before 36 x 24 mm film

  bool operator==(const ExifCamera&) const = default;
};

// Reads the EXIF block (CIPA DC-008) in a JPEG's first bytes; 64 KiB hold it. Whatever is missing, cut or nonsense
// stays empty: photographs without EXIF are normal.
ExifCamera ReadExifCamera(const std::string& jpeg_beginning);

}  // namespace meshwright
