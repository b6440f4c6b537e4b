// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <string>

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <absl/types/span.h>
#include <nlohmann/json_fwd.hpp>

#include "common/base/thread_pool.h"
#include "common/geometry/camera.h"
#include "common/mesh/triangle_mesh.h"

namespace meshwright {

struct EvaluationOptions {
  int pixel_stride = 2;            // px, >= 1; every n-th pixel in x and y is looked at
  int min_views = 3;               // >= 1; recall asks only for what that many cameras see
  double occlusion_tolerance = 4;  // pixel footprints, 0 .. 100; a point this far behind a surface still counts as seen
  double completeness_distance = 0;  // scene units, >= 0; of Middlebury's completeness. 0: two median pixel footprints

  absl::Status Validate() const;
};

// How near a reconstruction is to the ground truth, as the photographs see it. g is the pixel footprint z / f at the
// point in question. Shares are in [0, 1] and 0 where there is nothing to count. Array entries belong to kThresholds.
struct EvaluationReport {
  static constexpr std::array<int, 4> kThresholds = {1, 2, 4, 8};  // k
  using PerThreshold = std::array<double, kThresholds.size()>;

  // Ground-truth pixels whose surface point at least min_views cameras see: the share within k g of the reconstruction.
  PerThreshold recall = {};
  // Pixels of the reconstruction where ground truth is in the same pixel: the share within k g of the ground truth.
  PerThreshold precision = {};
  // Harmonic mean of recall and precision.
  PerThreshold f_score = {};
  // All ground-truth pixels: the share where the reconstruction's depth is off by less than k g (Strecha et al. 2008,
  // cumulative histogram); a pixel without reconstruction is wrong.
  PerThreshold depth = {};
  double missing = 0;            // share of all ground-truth pixels without reconstruction along the ray
  double median_accuracy_g = 0;  // distance to the ground truth, in g, over the pixels of precision; infinite beyond 8

  // Normals of two meshes, where the reconstruction's pixel lies within 2 g of the ground truth's: of the triangles, so
  // what shading shows. Degrees; 0 for clouds.
  double median_normal_error_deg = 0;
  double normals_within_10_deg = 0;  // share
  double normals_within_30_deg = 0;  // share
  // Mean angle between the normals at one pixel and at the next one looked at to its right, and the ground truth's
  // there.
  double roughness_deg = 0;
  double ground_truth_roughness_deg = 0;

  // Seitz et al. 2006, over points spread evenly over the surfaces (all points of a cloud; Middlebury: vertices).
  double accuracy_90 = 0;            // scene units; 90 % of the reconstruction is this near to the ground truth
  double completeness = 0;           // share of the ground truth, where min_views cameras see it, within the distance
  double completeness_distance = 0;  // scene units

  double median_footprint = 0;  // scene units; median of g over all ground-truth pixels
  int64_t ground_truth_pixels = 0;
  int64_t recall_pixels = 0;
  int64_t precision_pixels = 0;
};

// Compares a mesh or a point cloud (no faces) with a ground-truth mesh as the cameras see them. A cloud is seen point
// by point: each pixel shows the nearest point in it, and the distance to a cloud is that to its nearest point.
// `cameras` are of the size at which the comparison is made. The same report whatever the number of threads.
// InvalidArgument: options, no cameras, a ground truth without faces or out of all cameras' sight, a face that names no
// vertex.
absl::StatusOr<EvaluationReport> Evaluate(const TriangleMesh& reconstruction, const TriangleMesh& ground_truth,
                                          absl::Span<const Camera> cameras, const EvaluationOptions& options,
                                          ThreadPool& pool);

// Keys are the fields' names; arrays become objects keyed by k; what is infinite becomes null.
nlohmann::ordered_json ToJson(const EvaluationReport& report);

// A table for people, ending in a newline.
std::string ToText(const EvaluationReport& report);

}  // namespace meshwright
