// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <functional>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "common/scene/formats/import.h"
#include "common/scene/formats/small_scenes.h"
#include "common/scene/view.h"
#include "tests/scene_formats/scene_writers.h"

namespace meshwright {
namespace {

// Whatever happens to its files, a scene is either read or refused in one line that names a file.
class FaultInjection : public testing::TestWithParam<std::function<SceneFiles()>> {
 protected:
  void ForEachFile(const std::function<void(const std::string& file, const std::string& bytes)>& body) {
    const SceneFiles files = GetParam()();
    folder_ = FreshFolder("fault");
    WriteScene(folder_, files);
    ASSERT_TRUE(ImportScene(folder_, options_).ok());
    for (const auto& [file, bytes] : files) {
      if (file.ends_with(".png")) continue;
      body(file, bytes);
      WriteScene(folder_, {{file, bytes}});
    }
  }

  // Returns whether the scene could be read.
  bool ImportDamaged(const std::string& file, const std::string& bytes) {
    WriteScene(folder_, {{file, bytes}});
    const absl::StatusOr<Scene> scene = ImportScene(folder_, options_);
    if (scene.ok()) {
      for (const SceneView& view : scene->views) EXPECT_TRUE(view.cam_from_world.translation.allFinite());
      EXPECT_TRUE(LoadView(scene->views.front(), 8).ok());
      return true;
    }
    const std::string message(scene.status().message());
    EXPECT_TRUE(absl::IsInvalidArgument(scene.status()) || absl::IsNotFound(scene.status())) << scene.status();
    EXPECT_EQ(message.find('\n'), std::string::npos) << message;
    EXPECT_NE(message.find(folder_), std::string::npos) << message;
    return false;
  }

  // Every `least`-th byte of small files, and of the others as many as take a second; a prime, so that all of a record
  // is met.
  static size_t Stride(const std::string& bytes, size_t least) {
    size_t stride = least;
    for (const size_t prime : {3, 7, 13, 23, 37, 53}) {
      if (bytes.size() / stride > 300 * least) stride = std::max(stride, prime);
    }
    return bytes.size() < 1200 ? least : stride;
  }

  std::string folder_;
  const ImportOptions options_ = {.intrinsics = {{20, 20, 6, 5}}};  // for formats that have none
};

TEST_P(FaultInjection, Truncation) {
  ForEachFile([&](const std::string& file, const std::string& bytes) {
    const bool binary = file.ends_with(".bin");
    for (size_t length = 0; length < bytes.size(); length += Stride(bytes, binary ? 1 : 2)) {
      const bool read = ImportDamaged(file, bytes.substr(0, length));
      // Text may end anywhere and still make sense; a binary file may not.
      if (binary) {
        EXPECT_FALSE(read) << file << " cut to " << length << " bytes";
      }
    }
  });
}

TEST_P(FaultInjection, FlippedBits) {
  ForEachFile([&](const std::string& file, const std::string& bytes) {
    for (size_t i = 0; i < bytes.size(); i += Stride(bytes, 1)) {
      std::string damaged = bytes;
      damaged[i] = static_cast<char>(damaged[i] ^ (1 << ((i * 5) % 8)));
      ImportDamaged(file, damaged);
    }
  });
}

TEST_P(FaultInjection, ExtremeBytes) {
  ForEachFile([&](const std::string& file, const std::string& bytes) {
    for (size_t i = 0; i < bytes.size(); i += Stride(bytes, 3)) {
      std::string damaged = bytes;
      damaged[i] = '\0';
      ImportDamaged(file, damaged);
      damaged[i] = '\xFF';
      ImportDamaged(file, damaged);
    }
  });
}

TEST_P(FaultInjection, Noise) {
  ForEachFile([&](const std::string& file, const std::string&) {
    uint32_t state = 1;
    for (size_t length = 1; length < 2000; length *= 3) {
      std::string noise;
      for (size_t i = 0; i < length; ++i) {
        state = state * 1664525 + 1013904223;
        noise += static_cast<char>(state >> 24);
      }
      EXPECT_FALSE(ImportDamaged(file, noise)) << file;
    }
  });
}

std::vector<std::function<SceneFiles()>> SmallScenes() {
  std::vector<std::function<SceneFiles()>> scenes = {SmallColmapText, SmallColmapBinary, SmallMiddlebury, SmallStrecha};
  std::string last;
  for (const SceneWriter& writer : SceneWriters()) {
    if (writer.format != last) scenes.push_back([&writer] { return SmallSceneAs(writer); });
    last = writer.format;
  }
  return scenes;
}

INSTANTIATE_TEST_SUITE_P(Formats, FaultInjection, testing::ValuesIn(SmallScenes()));

}  // namespace
}  // namespace meshwright
