// SPDX-License-Identifier: Apache-2.0
#include "tests/scale/wall_world.h"

#include <algorithm>
#include <cmath>
#include <filesystem>

#include <absl/strings/str_format.h>

#include "common/base/check.h"
#include "common/image/encode.h"
#include "common/scene/formats/export_colmap.h"

namespace meshwright::scale {
namespace {

namespace fs = std::filesystem;

constexpr int kWidth = 32;   // px
constexpr int kHeight = 24;  // px
constexpr double kFocal = 30;
constexpr double kDistance = 4;  // to the wall
constexpr double kSpacing = 0.5;
constexpr double kPointSpacing = 0.25;
constexpr double kHalfView = kDistance * kWidth / 2 / kFocal;

}  // namespace

Camera WallWorld::CameraAt(int index) {
  Camera camera{
      .width = kWidth, .height = kHeight, .fx = kFocal, .fy = kFocal, .cx = kWidth / 2.0, .cy = kHeight / 2.0};
  camera.cam_from_world.translation = {-kSpacing * index, 0, kDistance};
  return camera;
}

void WallWorld::Write(const std::string& folder) const {
  Scene scene;
  for (int i = 0; i < cameras_; ++i) {
    const Camera camera = CameraAt(i);
    SceneView view;
    view.name = absl::StrFormat("%06d.png", i);
    view.lens = {.width = kWidth, .height = kHeight, .fx = kFocal, .fy = kFocal, .cx = camera.cx, .cy = camera.cy};
    view.cam_from_world = camera.cam_from_world;
    scene.views.push_back(view);
  }
  const double end = kSpacing * (cameras_ - 1) + kHalfView;
  for (double x = -kHalfView; x < end; x += kPointSpacing) {
    for (const double y : {-0.8, 0.8}) {
      SparsePoint point{.x_in_world = {x, y, 0}};
      const int first = std::max(0, static_cast<int>(std::ceil((x - kHalfView) / kSpacing)));
      const int last = std::min(cameras_ - 1, static_cast<int>(std::floor((x + kHalfView) / kSpacing)));
      for (int i = first; i <= last; ++i) point.seen_by.push_back(i);
      scene.points.push_back(point);
    }
  }
  MW_CHECK(ExportColmapText(scene, folder + "/model").ok());

  fs::create_directories(folder + "/images");
  // A file has 65,000 names at most.
  constexpr size_t kMostLinks = 50'000;
  std::string picture;
  for (size_t i = 0; i < scene.views.size(); ++i) {
    const std::string name = folder + "/images/" + scene.views[i].name;
    if (i % kMostLinks == 0) {
      picture = name;
      MW_CHECK(WritePng(picture, {kWidth, kHeight, std::vector<uint8_t>(3 * kWidth * kHeight, 128)}).ok());
    } else {
      fs::create_hard_link(picture, name);
    }
  }
}

PatchLattice WallWorld::FilteredSurface(CameraIndex index) {
  PatchLattice surface = PatchLattice::Empty(index, CameraAt(index), 2);
  const Lattice& lattice = surface.lattice;
  for (int row = 0; row < lattice.rows; ++row) {
    for (int column = 0; column < lattice.columns; ++column) {
      const auto node = static_cast<size_t>(lattice.Index(column, row));
      surface.depth[node] = static_cast<float>(kDistance);
      surface.normal_in_world[node] = {0, 0, -1};
      surface.quality[node] = 0.9F;
      if (column + 1 < lattice.columns) surface.links[node] |= PatchLattice::kLinkRight;
      if (row + 1 < lattice.rows) surface.links[node] |= PatchLattice::kLinkDown;
    }
  }
  return surface;
}

}  // namespace meshwright::scale
