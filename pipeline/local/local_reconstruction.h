// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include <absl/status/statusor.h>
#include <nlohmann/json.hpp>

#include "pipeline/local/job_runner.h"
#include "pipeline/local/local_progress.h"
#include "pipeline/options/reconstruction_options.h"
#include "pipeline/texturing/texture_options.h"

#include "common/mesh/formats/mesh_format.h"
#include "common/scene/scene.h"
#include "common/surface/patch_lattice.h"

namespace meshwright {

// Where a reconstruction's files go and what it may use. Nothing here changes the mesh.
struct LocalSettings {
  std::string output_path;  // the mesh, in the format that its ending says
  MeshWriteOptions write;   // of a mesh without a texture
  // Of a format that carries one: the mesh is simplified and gets its colours from an atlas. None: all of the mesh,
  // with colours at its vertices.
  std::optional<TextureOptions> texture;
  std::string report_path;               // report.json
  std::string cameras_path;              // gets the refined cameras if they were moved; "": nowhere
  std::string page_path;                 // the report as one HTML page; "": none
  std::string parts_folder;              // one PLY per reference camera; "": none
  std::string work_folder;               // state and surfaces
  bool restart = false;                  // throw away what the work folder holds
  bool keep_work_folder = false;         // do not remove it at the end
  int threads = 1;                       // cores to use, >= 1
  int64_t memory_limit_bytes = 1 << 30;  // how many jobs run at the same time follows from it
  // Told of every accepted surface M_r before the mesh is written; may be empty.
  std::function<void(const PatchLattice&)> accepted_listener;
  // Adds what it knows to the report before that is written, with the whole mesh as PLY at hand; may be empty.
  std::function<absl::Status(const std::string& ply_path, nlohmann::ordered_json& report)> add_to_report;
};

// The whole of section 3 of Jancosek et al. 2009 in one process: scene in, mesh and report.json out. May be killed at
// any moment; called again with the same scene and options it goes on from the last commit and writes the same bytes.
// Returns the report. Errors marked BadInput are the scene's.
absl::StatusOr<nlohmann::ordered_json> ReconstructLocally(const Scene& scene, const ReconstructionOptions& options,
                                                          const LocalSettings& settings, const CameraJobFunction& job,
                                                          const ProgressListener& listener);

// How many jobs may run at the same time: a job more than the window is never there, and cores beyond one per job help
// inside jobs.
int ConcurrentJobs(const ReconstructionOptions& options, int threads);

}  // namespace meshwright
