// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "common/base/thread_pool.h"
#include "common/geometry/camera.h"
#include "common/image/color_image.h"
#include "common/mesh/triangle_mesh.h"
#include "common/scene/scene.h"

namespace meshwright {

enum class SyntheticKind {
  kFacade,  // a house front with windows, ledges and columns, seen from an arc of cameras at two heights
  kRing,    // an object on a turntable before black, seen from a ring; with many cameras the views are redundant
  kRoom,    // plain walls, glossy cupboards, a wooden floor; people walk through it with a camera at their eyes
  kStreet,  // two rows of houses; cameras walk along the street, the files are in no order. Grows with the cameras
};

// "facade", "ring", "room", "street".
std::string SyntheticKindName(SyntheticKind kind);
absl::StatusOr<SyntheticKind> ParseSyntheticKind(const std::string& name);

struct SyntheticOptions {
  SyntheticKind kind = SyntheticKind::kFacade;
  int cameras = 10;                    // 2 .. 10000; facade at most 24
  int width = 800;                     // px, 64 .. 8192
  int height = 600;                    // px, 64 .. 8192
  uint64_t seed = 1;                   // of everything that is drawn by lot
  double noise_sigma = 1.5;            // grey levels, 0 .. 50; of the sensor
  double exposure_ev = 0;              // 0 .. 4; exposures of photographs differ by up to so much from the mean, EV
  int jpeg_quality = 0;                // 0 .. 100; photographs went through JPEG of this quality; 0: not
  double camera_noise_px = 0;          // 0 .. 20; by how much the scene's cameras are turned from the true ones
  int sparse_points_per_camera = 150;  // 0 .. 100000; what structure from motion would have found. 0: no points

  absl::Status Validate() const;
};

// Photographs of a world whose geometry is known exactly.
struct SyntheticScene {
  Scene scene;                     // plain pinhole lenses; image paths are empty until written
  std::vector<Camera> cameras;     // that took the photographs; scene.views' are off by camera_noise_px
  std::vector<ColorImage> images;  // of scene.views
  TriangleMesh ground_truth;       // the very triangles that were photographed; normals are those of the shading
};

// The same options give the same bytes, whatever the number of threads. InvalidArgument as options.Validate().
absl::StatusOr<SyntheticScene> MakeSyntheticScene(const SyntheticOptions& options, ThreadPool& pool);

// Writes `folder`/model (COLMAP text), `folder`/images (PNG) and `folder`/ground_truth.ply, making the folders.
absl::Status WriteSyntheticScene(const SyntheticScene& scene, const std::string& folder, ThreadPool& pool);

}  // namespace meshwright
