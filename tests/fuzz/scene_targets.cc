// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <iterator>
#include <string>
#include <system_error>
#include <vector>

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>

#include "pipeline/cameras/exif.h"

#include "common/base/check.h"
#include "common/base/digest.h"
#include "common/base/relative_path.h"
#include "common/base/temporary_folder_testing.h"
#include "common/image/decode.h"
#include "common/image/encode.h"
#include "common/scene/formats/import.h"
#include "common/scene/formats/small_scenes.h"
#include "common/scene/scene_codec.h"
#include "common/scene/view.h"
#include "tests/fuzz/target.h"

namespace meshwright::fuzz {
namespace {

// The files of a scene in one text: "=== NAME" before each.
constexpr char kFile[] = "\n=== ";

std::string Packed(const SceneFiles& files) {
  std::string text;
  for (const auto& [name, bytes] : files) absl::StrAppend(&text, kFile, name, "\n", bytes);
  return text;
}

bool IsPlainName(const std::string& name) {
  if (name.size() > 60 || !ValidateRelativePath(name).ok()) return false;
  return name.find_first_not_of("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_.-/") ==
         std::string::npos;
}

SceneFiles Unpacked(const std::string& text) {
  SceneFiles files;
  const std::string marker = kFile;
  for (size_t at = text.find(marker); at != std::string::npos && files.size() < 40;) {
    const size_t begin = at + marker.size();
    const size_t line_end = text.find('\n', begin);
    if (line_end == std::string::npos) break;
    at = text.find(marker, line_end);
    const std::string name = text.substr(begin, line_end - begin);
    if (!IsPlainName(name)) continue;
    files[name] = text.substr(line_end + 1, at == std::string::npos ? at : at - line_end - 1);
  }
  // A name that is a folder and a file cannot be written.
  for (auto it = files.begin(); it != files.end();) {
    const auto next = std::next(it);
    const bool is_folder = next != files.end() && absl::StartsWith(next->first, it->first + "/");
    it = is_folder ? files.erase(it) : next;
  }
  return files;
}

void ReadScene(const std::string& bytes) {
  const TemporaryFolder folder;
  for (const auto& [name, content] : Unpacked(bytes)) {
    std::error_code error;  // "a" beside "a/b" in another order
    std::filesystem::create_directories(std::filesystem::path(folder / name).parent_path(), error);
    if (!error && !std::filesystem::is_directory(folder / name)) folder.Write(name, content);
  }
  const absl::StatusOr<Scene> scene = ImportScene(folder.path());
  if (!scene.ok()) return;
  MW_CHECK(!scene->views.empty());
  for (const SceneView& view : scene->views) {
    const Camera camera = UndistortedCamera(view, 0);
    MW_CHECK(camera.width > 0 && camera.height > 0 && std::isfinite(camera.fx) && camera.fx > 0);
    MW_CHECK(view.cam_from_world.rotation.allFinite() && view.cam_from_world.translation.allFinite());
  }
  for (const SparsePoint& point : scene->points) {
    MW_CHECK(point.x_in_world.allFinite());
    for (const CameraIndex i : point.seen_by) MW_CHECK(i >= 0 && static_cast<size_t>(i) < scene->views.size());
  }
  const std::string encoded = EncodeScene(*scene);
  const absl::StatusOr<Scene> again = DecodeScene(encoded);
  MW_CHECK(again.ok() && EncodeScene(*again) == encoded);
}

void ReadSceneBytes(const std::string& bytes) {
  constexpr size_t kDigestSize = 64;
  // As it is, and with the digest that belongs to it: whoever means harm has it right.
  std::string fitting = bytes.substr(0, bytes.size() - std::min(bytes.size(), kDigestSize));
  fitting += Sha256Hex(fitting);
  for (const std::string& text : {bytes, fitting}) {
    const absl::StatusOr<Scene> scene = DecodeScene(text);
    if (!scene.ok()) continue;
    // Not always the same text: what version 1 wrote is read too.
    const std::string encoded = EncodeScene(*scene);
    const absl::StatusOr<Scene> again = DecodeScene(encoded);
    MW_CHECK(again.ok() && EncodeScene(*again) == encoded);
  }
}

void ReadPicture(const std::string& bytes) {
  const absl::StatusOr<ColorImage> image = DecodeImageBytes(bytes, "picture");
  const absl::StatusOr<ImageSize> size = CheckImageBytes(bytes, "picture");
  MW_CHECK(size.ok() == image.ok());
  if (!image.ok()) return;
  MW_CHECK(size->width == image->width && size->height == image->height);
  MW_CHECK(image->rgb.size() == size_t{3} * static_cast<size_t>(image->width) * static_cast<size_t>(image->height));
}

void ReadExif(const std::string& bytes) {
  const ExifCamera camera = ReadExifCamera(bytes);
  MW_CHECK(std::isfinite(camera.focal_mm) && std::isfinite(camera.focal_35mm));
}

ColorImage SmallImage() {
  ColorImage image{9, 7, {}};
  for (int i = 0; i < 3 * 9 * 7; ++i) image.rgb.push_back(static_cast<uint8_t>(i * i));
  return image;
}

// A JPEG's beginning with an EXIF block: make, focal length, and the folder that has it in 35 mm.
std::string SomeExif(bool big_endian) {
  std::string tiff;
  const auto add = [&](uint32_t value, int size) {
    for (int i = 0; i < size; ++i) tiff.push_back(static_cast<char>(value >> (8 * (big_endian ? size - 1 - i : i))));
  };
  tiff = big_endian ? "MM" : "II";
  add(42, 2);
  add(8, 4);
  add(2, 2);  // entries: make, EXIF folder
  for (const uint32_t value : {0x010FU, 2U}) add(value, 2);
  add(4, 4);
  tiff += std::string("ACM\0", 4);
  for (const uint32_t value : {0x8769U, 4U}) add(value, 2);
  add(1, 4);
  add(38, 4);
  add(0, 4);
  add(2, 2);
  for (const uint32_t value : {0x920AU, 5U}) add(value, 2);
  add(1, 4);
  add(68, 4);
  for (const uint32_t value : {0xA405U, 3U}) add(value, 2);
  add(1, 4);
  add(50, 2);
  add(0, 2);
  add(0, 4);
  add(350, 4);
  add(10, 4);
  const auto length = static_cast<uint16_t>(tiff.size() + 8);
  return std::string("\xFF\xD8\xFF\xE1", 4) + static_cast<char>(length >> 8) + static_cast<char>(length & 0xFF) +
         std::string("Exif\0\0", 6) + tiff + std::string("\xFF\xDA\x00\x08", 4);
}

}  // namespace

std::vector<Target> SceneTargets() {
  const std::vector<std::string> scenes = {Packed(SmallColmapText()), Packed(SmallColmapBinary()),
                                           Packed(SmallMiddlebury()), Packed(SmallStrecha())};
  const TemporaryFolder folder;
  WriteScene(folder.path(), SmallColmapBinary());
  const Scene scene = ImportScene(folder.path()).value();
  const std::string grey_pgm = "P5 3 2 255\n" + std::string(6, 'g');
  return {
      {"scene",
       ReadScene,
       scenes,
       {"\n=== ", "PINHOLE", "SIMPLE_RADIAL", "OPENCV_FISHEYE", "nan", "inf", "-1", "1e308", "4294967296",
        "cameras.txt", "images.txt", "points3D.txt", "images/a.png"}},
      {"scene_bytes", ReadSceneBytes, {EncodeScene(scene)}, {}},
      {"picture",
       ReadPicture,
       {EncodePng(SmallImage()), EncodeJpeg(SmallImage(), 90), grey_pgm},
       {"P5", "P6", "65535", "IHDR", "IDAT", "\xFF\xD8", "\xFF\xC2", "\xFF\xDA"}},
      {"exif", ReadExif, {SomeExif(false), SomeExif(true)}, {"II", "MM", std::string("Exif\0\0", 6)}},
  };
}

}  // namespace meshwright::fuzz
