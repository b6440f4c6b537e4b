// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "common/base/ids.h"
#include "common/geometry/lens.h"
#include "common/geometry/oriented_box.h"
#include "common/geometry/rigid3.h"

namespace meshwright {

// One photograph with its camera as the file describes it: the lens may distort, the picture is not decoded.
struct SceneView {
  std::string name;        // as the scene's file calls the image, made UTF-8 (ToUtf8); unique
  std::string image_path;  // where the picture is
  Lens lens;               // intrinsics and distortion at the size of the picture
  Rigid3 cam_from_world;
  std::string mask_path = {};  // of a picture that is black where this one is not to be used; "": it is used whole
};

// A point of the sparse reconstruction (structure from motion) with the cameras that saw it.
struct SparsePoint {
  Eigen::Vector3d x_in_world = Eigen::Vector3d::Zero();
  std::array<uint8_t, 3> rgb = {0, 0, 0};
  std::vector<CameraIndex> seen_by;  // sorted, unique
};

// What goes in: photographs with known cameras, and sparse points when structure from motion left some. Views are
// sorted by name, points by (seen_by, x), so that a scene does not depend on the order in its files.
struct Scene {
  std::string format;  // the name of one of SceneFormats()
  std::vector<SceneView> views;
  std::vector<SparsePoint> points;
  // What poses and points of the file were moved by: world = local + offset. Not 0 where the file's coordinates are far
  // from it (UTM, ECEF), as surfaces and most formats of meshes have floats. Outside of this struct everything is local
  // until a mesh is written.
  Eigen::Vector3d offset = Eigen::Vector3d::Zero();
  // What is outside of it is not reconstructed. Local, as poses are.
  std::optional<OrientedBox> region = std::nullopt;
  // What was left out or doubted when the scene was read, a line each; for people, no part of what the scene is.
  std::vector<std::string> warnings = {};
};

}  // namespace meshwright
