#pragma once

#include <string>
#include <vector>

#include <absl/status/status.h>
#include <nlohmann/json.hpp>

#include "common/mesh/joined_mesh.h"
#include "coordinator/options/conductor_options.h"
#include "worker/camera_job/camera_job.h"

namespace meshwright {

// Everything beside the scene that the mesh depends on. Threads, memory and paths are not among it.
struct ReconstructionOptions {
  int max_image_size = 0;  // px, longest side of the images used; 0: as they are
  CameraJobOptions job;
  ConductorOptions conductor;
  JoinOptions join;

  absl::Status Validate() const;
};

// The one table of what users can set: visit(group, name, field, help) for every option. The command line, the options
// in report.json and the comparison with a work folder are all made from it. Sections are of Jancosek et al. 2009.
template <typename Options, typename Visitor>
void VisitOptions(Options& options, Visitor&& visit) {
  auto& pairs = options.conductor.pairs;
  auto& acceptance = options.conductor.acceptance;
  auto& targets = options.conductor.targets;
  auto& scoring = options.job.scoring;
  auto& seeding = options.job.seeding;
  auto& growing = options.job.growing;
  auto& filtering = options.job.filtering;

  const char* group = "ReconstructionConfig";
  visit(group, "max-image-size", options.max_image_size,
        "longest side of the images used, px; larger ones are scaled down together with their cameras; 0: as they are");
  visit(group, "lattice-step", options.job.lattice_step,
        "gamma: spacing of the reference camera's rays, px (3.3: 1 for small images, 2 for large ones)");
  visit(group, "support", acceptance.k_a,
        "K_a: other cameras that must have found a patch before it is accepted (3.7: 2 or 3)");
  visit(group, "window", options.conductor.window,
        "W: cameras chosen and not yet committed at the same time; part of the result, so a fixed number whatever the "
        "machine (README, order rule); 1 is the paper's sequential method");
  visit(group, "max-targets", targets.max_targets, "images that a reference camera is compared with, at most (1..16)");

  group = "Feasible pairs (3.2)";
  visit(group, "min-common-points", pairs.min_common_points, "sparse points that a pair of cameras must share");
  visit(group, "min-pair-angle", pairs.min_angle_deg, "smallest angle between the two cameras' rays, degrees");
  visit(group, "max-pair-angle", pairs.max_angle_deg, "largest angle between the two cameras' rays, degrees");
  visit(group, "min-scale-ratio", pairs.min_scale_ratio, "smaller by larger image of a ball, 0..1");

  group = "Seeds (3.5)";
  visit(group, "min-seed-angle", seeding.min_apical_angle_deg, "alpha_S: smallest apical angle of a seed, degrees");
  visit(group, "min-seeds-per-pair", seeding.min_seeds_per_pair, "m_S: pairs with fewer are no pair any more");
  visit(group, "min-seed-quality", seeding.min_quality, "photo-consistency that a seed must reach, -1..1");

  group = "Growing (3.6)";
  visit(group, "patch-radius", scoring.window_radius, "s: patches are compared on (2 s + 1)^2 pixels");
  visit(group, "similarity-scale", scoring.similarity_scale,
        "pixels of a window that differ so much from its centre count 1/e, grey levels");
  visit(group, "min-texture", scoring.min_texture_sigma, "standard deviation that a window must have, grey levels");
  visit(group, "min-quality", growing.min_quality, "photo-consistency that a grown patch must reach, -1..1");
  visit(group, "max-quality-deficit", growing.max_quality_deficit,
        "how much worse than the best on its ray a patch may be");
  visit(group, "max-patches-per-ray", growing.max_patches_per_ray, "patches kept on a ray");
  visit(group, "normal-radius", growing.normal_radius_steps, "normals come from patches this near, lattice steps");

  group = "Filtering (3.7)";
  visit(group, "no-patch-cost", filtering.no_patch_cost, "c0: cost of a ray without a patch");
  visit(group, "boundary-cost", filtering.boundary_cost, "e0: cost of a patch beside a ray without one");
  visit(group, "max-plane-distance", filtering.max_plane_distance_steps,
        "neighbours farther than this from each other's plane are different surfaces, d_r");
  visit(group, "max-normal-angle", filtering.max_normal_angle_deg, "as are those whose normals differ more, degrees");
  visit(group, "mrf-iterations", filtering.trws.max_iterations, "TRW-S iterations per window, at most");
  visit(group, "mrf-window", filtering.trws.window_nodes, "side of a window of the MRF, lattice nodes");
  visit(group, "mrf-margin", filtering.trws.margin_nodes, "what is solved around a window, lattice nodes");
  visit(group, "refinement-rounds", filtering.refinement.rounds,
        "rounds of moving depth to the peak of photo-consistency; 0 keeps the paper's steps");
  visit(group, "refinement-radius", filtering.refinement.window_radius,
        "in which patches are compared on (2 s + 1)^2 pixels with this s");
  visit(group, "smoothing-radius", filtering.refinement.smoothing_radius_steps,
        "depths are then fitted to neighbours this near at most, lattice steps; 0 leaves them as they are");

  group = "Acceptance (3.7)";
  visit(group, "max-surfaces", options.conductor.max_surfaces,
        "filtered surfaces of overlapping cameras that one camera is held against, the largest ones");
  visit(group, "support-radius", acceptance.support_radius_steps, "supporting patches lie this near, d_r");

  group = "Joining";
  visit(group, "min-component", options.join.min_component_faces, "pieces with fewer faces are left out");
  visit(group, "max-hole", options.join.max_hole_steps, "flat holes up to this wide are closed, lattice steps");
  visit(group, "blend", options.join.blend_steps, "colours run into each other this far from seams, lattice steps");
  visit(group, "simplify", options.join.simplify_footprints,
        "leave out triangles (and the colours at their corners) up to this error, pixel footprints g, 0..100; 0: none");
}

// One line of the table, for pages and for programs that offer the options to their users.
struct OptionDescription {
  std::string group;
  std::string name;
  nlohmann::ordered_json default_value;  // a whole or a real number; its type is the option's
  std::string help;
};
std::vector<OptionDescription> DescribeOptions();

// {"max-image-size": 0, ...} and the program's version: what a work folder must agree with.
nlohmann::ordered_json ToJson(const ReconstructionOptions& options);

// "--window was 3, now 1", one for each difference between two results of ToJson.
std::vector<std::string> DescribeDifferences(const nlohmann::ordered_json& before, const nlohmann::ordered_json& now);

}  // namespace meshwright
