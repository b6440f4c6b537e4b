// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>

#include <absl/status/statusor.h>

#include "pipeline/local/local_progress.h"

#include "common/scene/scene.h"

namespace meshwright {

// What other programs link (find_package(Meshwright), target Meshwright::meshwright): ImportScene of
// common/scene/formats/import.h reads a scene, Reconstruct makes the mesh, ReadPly of common/mesh/ply.h reads it.

struct ReconstructionRequest {
  std::string output_path;         // the mesh, PLY; required
  std::string report_path;         // report.json; "": output_path with ".report.json" in the place of its extension
  std::string work_folder;         // state while it runs, removed at the end; "": output_path + ".work"
  std::string options_json;        // {"window": 2}: names, units and bounds as in docs/options.md; "": the defaults
  int threads = 0;                 // cores to use; 0: all of this machine. No influence on the mesh
  int64_t memory_limit_bytes = 0;  // 0: 512 MiB for each thread, at least 1 GiB. No influence on the mesh
};

struct ReconstructionSummary {
  int cameras_processed = 0;
  int cameras_skipped = 0;  // their jobs failed; report.json has the reasons
  int64_t vertices = 0;
  int64_t faces = 0;
};

// The whole method in this process. May be killed at any moment: the same call goes on from the last committed camera
// and writes the same bytes. InvalidArgument names the option or path, its value and what was expected;
// FailedPrecondition: nothing could be reconstructed, or the work folder belongs to something else.
absl::StatusOr<ReconstructionSummary> Reconstruct(const Scene& scene, const ReconstructionRequest& request,
                                                  const ProgressListener& progress = nullptr);

}  // namespace meshwright
