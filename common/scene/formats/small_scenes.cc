// SPDX-License-Identifier: Apache-2.0
#include "common/scene/formats/small_scenes.h"

#include <array>
#include <filesystem>
#include <fstream>
#include <utility>
#include <vector>

#include "common/base/check.h"
#include "common/base/temporary_folder_testing.h"
#include "common/image/encode.h"
#include "common/scene/formats/assemble.h"

namespace meshwright {
namespace {

void AddPictures(const std::string& folder, SceneFiles* files) {
  for (const char* name : {"a.png", "b.png", "c.png"}) (*files)[JoinPath(folder, name)] = SmallPicture();
}

template <typename T>
void Append(const T& value, std::string* bytes) {
  bytes->append(reinterpret_cast<const char*>(&value), sizeof(value));
}

void AppendCamera(uint32_t id, int32_t model, const std::vector<double>& parameters, std::string* bytes) {
  Append(id, bytes);
  Append(model, bytes);
  Append(uint64_t{kSmallWidth}, bytes);
  Append(uint64_t{kSmallHeight}, bytes);
  for (const double parameter : parameters) Append(parameter, bytes);
}

void AppendImage(uint32_t id, const std::array<double, 7>& pose, uint32_t camera_id, const std::string& name,
                 uint64_t observations, std::string* bytes) {
  Append(id, bytes);
  Append(pose, bytes);
  Append(camera_id, bytes);
  bytes->append(name.c_str(), name.size() + 1);
  Append(observations, bytes);
  for (uint64_t i = 0; i < observations; ++i) {
    Append(1.5, bytes);
    Append(2.5, bytes);
    Append(int64_t{-1}, bytes);
  }
}

void AppendPoint(uint64_t id, const std::array<double, 3>& x, const std::vector<std::pair<uint32_t, uint32_t>>& track,
                 std::string* bytes) {
  Append(id, bytes);
  Append(x, bytes);
  Append(std::array<uint8_t, 3>{10, 20, 30}, bytes);
  Append(0.5, bytes);
  Append(uint64_t{track.size()}, bytes);
  for (const auto& [image, index] : track) {
    Append(image, bytes);
    Append(index, bytes);
  }
}

}  // namespace

std::string FreshFolder(const std::string& name) {
  static const TemporaryFolder root;
  std::string folder = JoinPath(root.path(), name);
  std::filesystem::remove_all(folder);
  std::filesystem::create_directories(folder);
  return folder;
}

void WriteScene(const std::string& folder, const SceneFiles& files) {
  for (const auto& [name, bytes] : files) {
    const std::string path = JoinPath(folder, name);
    std::filesystem::create_directories(std::filesystem::path(path).parent_path());
    // Not atomically: syncing thousands of files would be what the tests take their time for.
    std::ofstream stream(path, std::ios::binary);
    stream << bytes;
    MW_CHECK(stream.flush().good());
  }
}

std::string SmallPicture() {
  ColorImage image{.width = kSmallWidth, .height = kSmallHeight, .rgb = {}};
  for (int i = 0; i < 3 * kSmallWidth * kSmallHeight; ++i) image.rgb.push_back(static_cast<uint8_t>((7 * i) & 0xFF));
  return EncodePng(image);
}

SceneFiles SmallColmapText() {
  SceneFiles files;
  files["cameras.txt"] =
      "# Camera list\n"
      "3 PINHOLE 12 10 20 21 6 5\n"
      "7 OPENCV 12 10 20 20 6.5 5.25 0.01 -0.02 0.001 0\n";
  files["images.txt"] =
      "# Image list\n"
      "\n"
      "11 1 0 0 0 0 0 0 3 b.png\n"
      "1.5 2.5 4 2.5 3.5 -1 7 8 9\n"
      "5 0.70710678118654757 0.70710678118654757 0 0 1 2 3 7 a.png\n"
      "\n"
      "6 0 0 1 0 -1 0.5 2e0 3 c.png\n"
      "3 3 4\n";
  files["points3D.txt"] =
      "# Points\n"
      "4 1 2 3 10 20 30 0.5 11 0 6 0\n"
      "9 -1 -2 4 11 21 31 0.25 5 17 11 2 11 1\n"
      "10 0 0 4 1 2 3 nan 11 0 6 0 5 0\n"
      "12 -1 0 4 1 2 3 0 6 0 11 0\n";
  AddPictures("images", &files);
  return files;
}

SceneFiles SmallColmapBinary() {
  SceneFiles files;
  std::string& cameras = files["sparse/0/cameras.bin"];
  Append(uint64_t{2}, &cameras);
  AppendCamera(3, 1, {20, 21, 6, 5}, &cameras);
  AppendCamera(7, 4, {20, 20, 6.5, 5.25, 0.01, -0.02, 0.001, 0}, &cameras);
  std::string& images = files["sparse/0/images.bin"];
  Append(uint64_t{3}, &images);
  AppendImage(11, {1, 0, 0, 0, 0, 0, 0}, 3, "b.png", 3, &images);
  AppendImage(5, {0.70710678118654757, 0.70710678118654757, 0, 0, 1, 2, 3}, 7, "a.png", 0, &images);
  AppendImage(6, {0, 0, 1, 0, -1, 0.5, 2}, 3, "c.png", 1, &images);
  std::string& points = files["sparse/0/points3D.bin"];
  Append(uint64_t{4}, &points);
  AppendPoint(4, {1, 2, 3}, {{11, 0}, {6, 0}}, &points);
  AppendPoint(9, {-1, -2, 4}, {{5, 17}, {11, 2}, {11, 1}}, &points);
  AppendPoint(10, {0, 0, 4}, {{11, 0}, {6, 0}, {5, 0}}, &points);
  AppendPoint(12, {-1, 0, 4}, {{6, 0}, {11, 0}}, &points);
  AddPictures("images", &files);
  return files;
}

SceneFiles SmallMiddlebury() {
  SceneFiles files;
  files["small_par.txt"] =
      "3\n"
      "b.png 20 0 5.5 0 21 4.5 0 0 1 1 0 0 0 1 0 0 0 1 0 0 0\n"
      "a.png 20 0.5 6 0 20 4.75 0 0 1 1 0 0 0 0 -1 0 1 0 1 2 3\n"
      "c.png 20 0 5.5 0 21 4.5 0 0 1 -1 0 0 0 1 0 0 0 -1 -1 0.5 2\n";
  AddPictures("", &files);
  return files;
}

SceneFiles SmallStrecha() {
  SceneFiles files;
  files["cameras/b.png.camera"] = "20 0 5.5\n0 21 4.5\n0 0 1\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n0 0 0\n12 10\n";
  files["cameras/a.png.camera"] = "20 0.5 6\n0 20 4.75\n0 0 1\n0 0 0\n1 0 0\n0 0 1\n0 -1 0\n-1 -3 2\n12 10\n";
  files["cameras/c.png.camera"] = "20 0 5.5\n0 21 4.5\n0 0 1\n0 0 0\n-1 0 0\n0 1 0\n0 0 -1\n-1 -0.5 2\n12 10\n";
  AddPictures("images", &files);
  return files;
}

}  // namespace meshwright
