// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "common/geometry/rigid3.h"
#include "common/scene/scene.h"

namespace meshwright {

// What came out of looking whether a scene's cameras agree with its photographs.
struct CameraRefinement {
  // Of the scene's views, when they were moved; empty: they are best as they are.
  std::vector<Rigid3> cam_from_world;
  int64_t tie_points = 0;
  // Median distance between where points are in photographs and where the cameras see them, px of the photographs
  // used, of points that had no say: with the cameras that were given, and in the end.
  double error_px_before = 0;
  double error_px_after = 0;
  double off_px = 0;   // median, by how much points in the photographs moved with their cameras
  std::string reason;  // why they are as they were; "": they agree, or were moved

  bool moved() const { return !cam_from_world.empty(); }
};

// JSON text, as durable blobs have it.
std::string EncodeCameraRefinement(const CameraRefinement& refinement);
// DataLoss: not of EncodeCameraRefinement, or poses that are none.
absl::StatusOr<CameraRefinement> DecodeCameraRefinement(const std::string& text);

// Gives the views their refined poses, if any. FailedPrecondition: they are another scene's.
absl::Status ApplyRefinement(const CameraRefinement& refinement, Scene& scene);

}  // namespace meshwright
