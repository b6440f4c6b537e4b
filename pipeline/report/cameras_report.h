// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>

#include <absl/status/statusor.h>
#include <nlohmann/json.hpp>

#include "common/scene/scene.h"
#include "coordinator/store/job_store.h"

namespace meshwright {

// Sums over cameras that tell how much work the order rule and the suppression by accepted surfaces left to do.
struct ReportTotals {
  int cameras_processed = 0;
  int cameras_skipped = 0;
  int64_t rays = 0;                 // lattice rays of processed cameras
  int64_t rays_covered_before = 0;  // of these, covered by surfaces accepted before
  int64_t rays_grown = 0;
  int64_t rays_filtered = 0;
  int64_t rays_accepted = 0;
  int64_t seeds = 0;
  int64_t tentative_patches_scored = 0;
};

// {"cameras": [...], "totals": {...}}: per camera in the order of processing, with the shares of the paper's figure 7.
// Made from the store alone, so that a resumed reconstruction reports as one that ran through.
absl::StatusOr<nlohmann::ordered_json> MakeCamerasReport(const Scene& scene, JobStore& store,
                                                         const std::string& reconstruction_id, ReportTotals* totals);

}  // namespace meshwright
