// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "common/scene/formats/small_scenes.h"
#include "common/scene/scene.h"

// Scenes in the formats that other programs write, for the tests of their importers: made from the formats'
// definitions, not from the importers.
namespace meshwright {

// What a format can say of a lens; the rest has to be the least of it.
struct LensLimits {
  bool two_focals = true;
  bool free_center = true;  // of the principal point
  int radial = 0;           // coefficients
  bool tangential = false;
};

struct SceneWriter {
  const char* format;  // of SceneFormats()
  const char* variant;
  SceneFiles (*write)(const Scene& scene);  // all but the pictures
  LensLimits limits;
  bool has_points = true;  // with the cameras that see them
  bool has_intrinsics = true;
  double point_digits = 1e-9;  // of coordinates, relative
  // Where its pictures are, and how their names end in place of ".png".
  const char* picture_folder = "images/";
  const char* picture_ending = ".png";
};
const std::vector<SceneWriter>& SceneWriters();

// Path within the scene's folder of the picture of a view, which is called NAME.png.
std::string PicturePath(const SceneWriter& writer, const std::string& name);

// Three cameras, a.png, b.png and c.png of kSmallWidth x kSmallHeight px, and points that they see.
Scene SmallSceneWithin(const LensLimits& limits);

// A small scene in the format, with its pictures.
SceneFiles SmallSceneAs(const SceneWriter& writer);

}  // namespace meshwright
