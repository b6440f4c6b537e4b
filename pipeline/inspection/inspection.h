// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <absl/status/statusor.h>
#include <nlohmann/json.hpp>

#include "pipeline/options/reconstruction_options.h"

#include "common/base/thread_pool.h"
#include "common/scene/scene.h"

namespace meshwright {

struct SizeRange {
  int64_t smallest = 0;
  int64_t mean = 0;
  int64_t largest = 0;
};

// What a scene is and what its reconstruction will take, known before any photograph is decoded.
struct Inspection {
  std::string format;
  std::vector<std::string> warnings;  // of the scene: what was left out of it, and other scenes in the folder
  Eigen::Vector3d offset = Eigen::Vector3d::Zero();  // Scene::offset
  int photographs = 0;
  int masks = 0;     // photographs that have one
  SizeRange width;   // px, as used: undistorted and scaled
  SizeRange height;  // px
  int64_t pixels = 0;
  int64_t sparse_points = 0;
  bool pairs_from_points = false;  // section 3.2; otherwise from the optical axes
  int64_t pairs = 0;
  int64_t cameras_without_pair = 0;
  SizeRange neighbours;       // |O_r|
  SizeRange targets;          // of them in a job
  SizeRange overlapping;      // cameras that see the same surface
  int lattice_step = 0;       // px
  SizeRange lattice_columns;  // nodes
  SizeRange lattice_rows;     // nodes
  int64_t lattice_nodes = 0;  // of all cameras: what would be grown if nothing were suppressed
  int64_t job_bytes = 0;      // memory of the largest camera job, photographs included
  int64_t disk_bytes = 0;     // of the work folder, at most
};

// Bad input: no feasible pair of cameras.
absl::StatusOr<Inspection> Inspect(const Scene& scene, const ReconstructionOptions& options, ThreadPool& pool);

nlohmann::ordered_json ToJson(const Inspection& inspection);
// For people, ending in a newline.
std::string ToText(const Inspection& inspection);

}  // namespace meshwright
