// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <absl/status/status.h>

#include "common/base/ids.h"
#include "common/base/thread_pool.h"
#include "common/geometry/camera.h"
#include "common/geometry/oriented_box.h"
#include "common/image/color_image.h"
#include "common/image/sampling_image.h"
#include "common/surface/patch_lattice.h"
#include "worker/completion/completion.h"
#include "worker/filtering/filtering.h"
#include "worker/growing/growing.h"
#include "worker/seeding/seeding.h"
#include "worker/visibility/accepted_depth.h"

namespace meshwright {

// Everything that a camera job may do differently; the stages' constants with the paper's sections.
struct CameraJobOptions {
  int lattice_step = 2;  // gamma_r, px, 1..16 (section 3.3: 1 for Middlebury, 2 for larger photographs)
  PatchScorer::Options scoring;
  SeedingOptions seeding;
  GrowingOptions growing;
  FilteringOptions filtering;
  CompletionOptions completion;
  int halvings = 2;  // where nothing is found photographs are compared at half their size, so many times, 0..4

  absl::Status Validate() const;
};

// A photograph ready to be compared: undistorted, scaled, in the layout made for sampling. Shared between jobs.
struct JobView {
  CameraIndex camera_index = 0;
  Camera camera;
  std::shared_ptr<const SamplingImage> grey;
};

// What one reference camera's job works on. No paths, no stores: values.
struct CameraJobInput {
  JobView reference;
  std::shared_ptr<const ColorImage> reference_color;
  std::vector<JobView> targets;                // the chosen part of O_r, best first; at most kMaxTargets
  std::vector<Eigen::Vector3d> sparse_points;  // SfM points that the reference camera saw, world frame
  std::vector<std::vector<CameraIndex>> sparse_points_seen_by;  // parallel to sparse_points
  AcceptedDepth accepted;                                       // V_r as of the job's snapshot
  std::optional<OrientedBox> region;                            // in the world; nothing is looked for outside of it
};

constexpr int kMaxTargets = 16;

// Counts and times of one job, for report.json and the dashboard (shares as in the paper's figure 7).
struct CameraJobReport {
  int64_t rays = 0;                 // lattice nodes
  int64_t rays_covered_before = 0;  // rays with an accepted patch in V_r
  int64_t seeds = 0;
  int64_t seeds_from_points = 0;
  int64_t tentative_patches_scored = 0;
  int64_t patches_grown = 0;
  int64_t rays_grown = 0;     // rays with at least one grown patch
  int64_t rays_filtered = 0;  // rays with a patch that filtering left
  int64_t rays_inferred =
      0;  // rays that got their patch from smaller photographs or the plane around them: F_r has both
  double epipolar_squares = 0;  // of offsets across epipolar lines, px^2 summed over epipolar_measurements
  int64_t epipolar_measurements = 0;
  double mrf_energy = 0;
  double mrf_lower_bound = 0;
  double seconds_visibility = 0;  // filled in by whoever makes V_r
  double seconds_seeding = 0;     // wall
  double seconds_growing = 0;
  double seconds_filtering = 0;
  double seconds_refinement = 0;  // and completion
};

struct CameraJobResult {
  PatchLattice filtered;                  // F_r
  std::vector<CameraIndex> weak_targets;  // pairs (r, t) with fewer than m_S seeds, to be removed from CI
  CameraJobReport report;
};

// One reference camera, as sections 3.5 to 3.7 of Jancosek et al. 2009 read: seeds, growing, filtering; and what planes
// around textureless holes say (ours). The result
// depends on input and options alone, not on the number of threads in `pool`.
CameraJobResult RunCameraJob(const CameraJobInput& input, const CameraJobOptions& options, ThreadPool& pool);

// The same; `grown` gets G_r, for who wants to see what filtering chose from.
CameraJobResult RunFollowedCameraJob(const CameraJobInput& input, const CameraJobOptions& options, PatchStacks& grown,
                                     ThreadPool& pool);

// The sparse points with the targets that saw them.
std::vector<SparsePointObservation> ObservationsOf(const CameraJobInput& input);

// What the job compares photographs with.
PatchScorer MakeScorer(const CameraJobInput& input, const PatchScorer::Options& options);

// Bytes that RunCameraJob will need at most beside its input, for a reference of this size.
int64_t EstimateCameraJobBytes(const Camera& reference, const CameraJobOptions& options);

// What is left of the options when a job is made smaller after it ran out of memory: the lattice is spaced twice as
// wide each time, up to the widest.
CameraJobOptions Reduced(CameraJobOptions options, int reduction);

}  // namespace meshwright
