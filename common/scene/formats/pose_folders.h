// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include <absl/status/statusor.h>

#include "common/scene/formats/import_options.h"
#include "common/scene/scene.h"

// Folders of photographs with poses (camera to world, X right, Y down, Z forward) as benchmarks of robotics have them.
// They have neither intrinsics, which options.intrinsics has to say, nor sparse points. Errors: NotFound (a picture is
// missing), InvalidArgument (no intrinsics; else names file, line, field, value and what was expected).
namespace meshwright {

// 7-Scenes (Shotton et al. 2013): X.pose.txt, a matrix of four rows, beside X.color.png. A pose that is not finite is
// none.
std::string FindSevenScenes(const std::string& folder);
absl::StatusOr<Scene> ImportSevenScenes(const std::string& folder, const ImportOptions& options);

// TUM RGB-D (Sturm et al. 2012): rgb.txt (time, path) and groundtruth.txt (time tx ty tz qx qy qz qw). A photograph
// gets the pose next in time, at most 20 ms away.
std::string FindTum(const std::string& folder);
absl::StatusOr<Scene> ImportTum(const std::string& folder, const ImportOptions& options);

// Tanks and Temples (Knapitsch et al. 2017): one *.log of five lines a pose, "i j k" and a matrix; photograph i of
// those in images/, or beside it, sorted by name. j = -1 stands for a photograph without a pose.
std::string FindTanksAndTemples(const std::string& folder);
absl::StatusOr<Scene> ImportTanksAndTemples(const std::string& file, const ImportOptions& options);

}  // namespace meshwright
