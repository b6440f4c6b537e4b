// SPDX-License-Identifier: Apache-2.0
#include "worker/job_input/run_job.h"

#include <algorithm>
#include <utility>

#include <nlohmann/json.hpp>

#include "common/base/status_macros.h"
#include "common/json/json_text.h"
#include "common/surface/codec.h"

namespace meshwright {
namespace {

using Json = nlohmann::ordered_json;

// Seconds need no more digits than microseconds.
double Rounded(double seconds) {
  return std::max(0.0, 1e-6 * static_cast<double>(static_cast<int64_t>(1e6 * seconds)));
}

const std::string& NameOf(const Scene& scene, CameraIndex camera) {
  return scene.views[static_cast<size_t>(camera)].name;
}

// What is kept in the store about one finished job.
Json MakeJobReport(const Scene& scene, const CameraJobSpec& spec, const CameraJobReport& report,
                   double seconds_loading) {
  Json targets = Json::array();
  for (const CameraIndex target : spec.targets) targets.push_back(NameOf(scene, target));
  Json json;
  json["neighbours"] = spec.neighbours.size();
  json["targets"] = std::move(targets);
  json["seeds"] = report.seeds;
  json["seeds_from_points"] = report.seeds_from_points;
  json["tentative_patches_scored"] = report.tentative_patches_scored;
  json["patches_grown"] = report.patches_grown;
  json["rays"] = report.rays;
  json["rays_covered_before"] = report.rays_covered_before;
  json["rays_grown"] = report.rays_grown;
  json["rays_filtered"] = report.rays_filtered;
  json["rays_inferred"] = report.rays_inferred;
  json["epipolar_squares"] = report.epipolar_squares;
  json["epipolar_measurements"] = report.epipolar_measurements;
  json["mrf_energy"] = report.mrf_energy;
  json["mrf_lower_bound"] = report.mrf_lower_bound;
  json["seconds"] = {{"loading", Rounded(seconds_loading)},
                     {"visibility", Rounded(report.seconds_visibility)},
                     {"seeding", Rounded(report.seconds_seeding)},
                     {"growing", Rounded(report.seconds_growing)},
                     {"filtering", Rounded(report.seconds_filtering)},
                     {"refinement", Rounded(report.seconds_refinement)}};
  return json;
}

}  // namespace

absl::StatusOr<FinishedJob> RunJob(const Scene& scene, const CameraJobSpec& spec, const CameraJobInputMaker& inputs,
                                   const CameraJobFunction& job, BlobStore& blobs, ThreadPool& pool) {
  FinishedJob finished;
  // A camera that sees none of the region has nothing to do, not even to load photographs.
  if (scene.region.has_value() && !SeesAnyOf(inputs.camera(spec.camera), *scene.region, inputs.lattice_step())) {
    finished.report.rays = Lattice::For(inputs.camera(spec.camera), inputs.lattice_step()).nodes();
    finished.report_json = JsonText(MakeJobReport(scene, spec, finished.report, 0));
    const PatchLattice nothing = PatchLattice::Empty(spec.camera, inputs.camera(spec.camera), inputs.lattice_step());
    MW_ASSIGN_OR_RETURN(finished.filtered_digest, blobs.Put(EncodeSurface(nothing)));
    return finished;
  }
  MW_ASSIGN_OR_RETURN(CameraJobInputMaker::Prepared prepared, inputs.Make(spec, pool));
  CameraJobResult result = job(prepared.input, pool);
  result.report.seconds_visibility = prepared.seconds_visibility;
  finished.report = result.report;
  finished.weak_targets = std::move(result.weak_targets);
  finished.report_json = JsonText(MakeJobReport(scene, spec, finished.report, prepared.seconds_loading));
  prepared = {};  // photographs are gone before the surface is encoded
  MW_ASSIGN_OR_RETURN(finished.filtered_digest, blobs.Put(EncodeSurface(result.filtered)));
  return finished;
}

}  // namespace meshwright
