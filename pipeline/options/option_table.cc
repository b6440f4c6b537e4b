// SPDX-License-Identifier: Apache-2.0
#include "pipeline/options/option_table.h"

namespace meshwright {
namespace {

// The member of ReconstructionOptions that an option sets.
#define MW_FIELD(member) \
  [](ReconstructionOptions & options) -> auto& { return options.member; }

constexpr char kGeneral[] = "Reconstruction";
constexpr char kPairs[] = "Feasible pairs (3.2)";
constexpr char kSeeds[] = "Seeds (3.5)";
constexpr char kGrowing[] = "Growing (3.6)";
constexpr char kFiltering[] = "Filtering (3.7)";
constexpr char kAcceptance[] = "Acceptance (3.7)";
constexpr char kJoining[] = "Joining";

constexpr double kManyCameras = 100'000;
constexpr double kManyPoints = 1'000'000;

std::vector<Option> MakeTable() {
  return {
      {"max-image-size", kGeneral, "px", 0, 100'000,
       "longest side of the images used; larger ones are scaled down together with their cameras; 0: as they are",
       "half the size takes about a quarter of the time and loses the finest detail", MW_FIELD(max_image_size)},
      {"lattice-step", kGeneral, "px", 1, 16,
       "gamma: spacing of the reference camera's rays (3.3: 1 for small images, 2 for large ones)",
       "twice the step is about four times as fast, with a quarter of the vertices", MW_FIELD(job.lattice_step)},
      {"support", kGeneral, "", 1, 255,
       "K_a: other cameras that must have found a patch before it is accepted (3.7: 2 or 3)",
       "more: fewer errors and more holes", MW_FIELD(conductor.acceptance.k_a)},
      {"window", kGeneral, "", 1, kManyCameras,
       "W: cameras chosen and not yet committed at the same time; part of the result, so a fixed number whatever the "
       "machine (README, order rule); 1 is the paper's sequential method",
       "more: more workers are busy at the same time, and some surface is computed twice", MW_FIELD(conductor.window)},
      {"refine-cameras", kGeneral, "photographs", 0, kManyCameras,
       "cameras are moved to where their photographs agree better, if they do by a twentieth at least, in scenes of at "
       "most so many photographs; 0: they stay as they are",
       "more: large scenes with cameras that are a little wrong are less torn, after a stage that one process does",
       MW_FIELD(refine_cameras)},
      {"max-targets", kGeneral, "", 1, kMaxTargets, "images that a reference camera is compared with, at most",
       "more: steadier depths, in time that grows with it", MW_FIELD(conductor.targets.max_targets)},

      {"min-common-points", kPairs, "", 1, kManyPoints, "sparse points that a pair of cameras must share",
       "fewer: more pairs, also of cameras that hardly see the same surface",
       MW_FIELD(conductor.pairs.min_common_points)},
      {"min-pair-angle", kPairs, "degrees", 0, 180, "smallest angle between the two cameras' rays",
       "smaller: more pairs, with less certain depths", MW_FIELD(conductor.pairs.min_angle_deg)},
      {"max-pair-angle", kPairs, "degrees", 0, 180, "largest angle between the two cameras' rays",
       "larger: more pairs, in which photographs look less alike", MW_FIELD(conductor.pairs.max_angle_deg)},
      {"min-scale-ratio", kPairs, "", 0, 1, "smaller by larger image of a ball",
       "smaller: also pairs of cameras at different distances, whose images are less alike",
       MW_FIELD(conductor.pairs.min_scale_ratio)},

      {"min-seed-angle", kSeeds, "degrees", 0, 60, "alpha_S: smallest apical angle of a seed",
       "smaller: more seeds, with less certain depths", MW_FIELD(job.seeding.min_apical_angle_deg)},
      {"min-seeds-per-pair", kSeeds, "", 0, kManyPoints, "m_S: pairs with fewer are no pair any more",
       "more: fewer useless comparisons, and weak pairs are lost", MW_FIELD(job.seeding.min_seeds_per_pair)},
      {"min-seed-quality", kSeeds, "", -1, 1, "photo-consistency that a seed must reach",
       "higher: fewer wrong seeds, and surfaces with little texture are not begun", MW_FIELD(job.seeding.min_quality)},

      {"patch-radius", kGrowing, "px", 1, 7, "s: patches are compared on (2 s + 1)^2 pixels",
       "larger: less noise on weak texture, less detail, more time", MW_FIELD(job.scoring.window_radius)},
      {"similarity-scale", kGrowing, "grey levels", 0.1, 10'000,
       "pixels of a window that differ so much from its centre count 1/e",
       "smaller: sharper edges of depth, more noise", MW_FIELD(job.scoring.similarity_scale)},
      {"min-texture", kGrowing, "grey levels", 0, 255, "standard deviation that a window must have",
       "lower: fewer holes where there is hardly any texture, and more errors there",
       MW_FIELD(job.scoring.min_texture_sigma)},
      {"min-quality", kGrowing, "", -1, 1, "photo-consistency that a grown patch must reach",
       "lower: fewer holes, more errors, more time", MW_FIELD(job.growing.min_quality)},
      {"max-quality-deficit", kGrowing, "", 0, 2, "how much worse than the best on its ray a patch may be",
       "more: filtering has more to choose from, in more time", MW_FIELD(job.growing.max_quality_deficit)},
      {"max-patches-per-ray", kGrowing, "", 1, 32, "patches kept on a ray",
       "more: filtering has more to choose from, in more time and memory", MW_FIELD(job.growing.max_patches_per_ray)},
      {"normal-radius", kGrowing, "lattice steps", 1, 16, "normals come from patches this near",
       "larger: steadier normals, rounder edges", MW_FIELD(job.growing.normal_radius_steps)},

      {"no-patch-cost", kFiltering, "", 0, 1000, "c0: cost of a ray without a patch",
       "more: fewer holes, more wrong patches stay", MW_FIELD(job.filtering.no_patch_cost)},
      {"boundary-cost", kFiltering, "", 0, 1000, "e0: cost of a patch beside a ray without one",
       "more: shorter borders, small pieces vanish", MW_FIELD(job.filtering.boundary_cost)},
      {"max-plane-distance", kFiltering, "d_r", 0.01, 1000,
       "neighbours farther than this from each other's plane are different surfaces",
       "larger: noise is bridged, and so are small steps of depth", MW_FIELD(job.filtering.max_plane_distance_steps)},
      {"max-normal-angle", kFiltering, "degrees", 0, 180, "as are those whose normals differ more",
       "larger: sharp edges stay connected, and so do errors", MW_FIELD(job.filtering.max_normal_angle_deg)},
      {"mrf-iterations", kFiltering, "", 1, 1000, "TRW-S iterations per window, at most",
       "more: a lower energy where it has not converged, in more time", MW_FIELD(job.filtering.trws.max_iterations)},
      {"mrf-window", kFiltering, "lattice nodes", 4, 1024, "side of a window of the MRF, at least 2 mrf-margin + 2",
       "larger: nearer to the optimum of the whole image, in more memory", MW_FIELD(job.filtering.trws.window_nodes)},
      {"mrf-margin", kFiltering, "lattice nodes", 1, 256, "what is solved around a window",
       "more: seams between windows are seen less, in more time", MW_FIELD(job.filtering.trws.margin_nodes)},
      {"refinement-rounds", kFiltering, "", 0, 8,
       "rounds of moving depth to the peak of photo-consistency; 0 keeps the paper's steps",
       "more: more accurate depths, in more time", MW_FIELD(job.filtering.refinement.rounds)},
      {"refinement-radius", kFiltering, "px", 1, 7, "in which patches are compared on (2 s + 1)^2 pixels with this s",
       "larger: less noise, less detail", MW_FIELD(job.filtering.refinement.window_radius)},
      {"smoothing-radius", kFiltering, "lattice steps", 0, 8,
       "depths are then fitted to neighbours this near at most; 0 leaves them as they are",
       "larger: smoother surfaces, rounder edges", MW_FIELD(job.filtering.refinement.smoothing_radius_steps)},
      {"halvings", kFiltering, "", 0, 4,
       "where nothing is found photographs are compared at half their size, and again, so many times; 0: never",
       "more: fewer holes in what is out of focus or has little texture, less accurate, in more time",
       MW_FIELD(job.halvings)},
      {"infer-reach", kFiltering, "of the photograph's longer side", 0, 1,
       "where a photograph shows no texture, the plane of the surface this near around it closes the hole; 0: none",
       "more: larger plain walls are closed, with surface that no photograph confirms",
       MW_FIELD(job.completion.max_reach)},

      {"max-surfaces", kAcceptance, "", 1, 10'000,
       "filtered surfaces of overlapping cameras that one camera is held against, the largest ones",
       "more: a little more surface is confirmed in dense sets, in more time", MW_FIELD(conductor.max_surfaces)},
      {"support-radius", kAcceptance, "d_r", 0.1, 16, "supporting patches lie this near",
       "larger: fewer holes, less accurate depths are confirmed", MW_FIELD(conductor.acceptance.support_radius_steps)},

      {"min-component", kJoining, "faces", 0, 1'000'000'000, "pieces with fewer faces are left out",
       "more: less debris, and small things vanish", MW_FIELD(join.min_component_faces)},
      {"max-hole", kJoining, "lattice steps", 0, 1000, "flat holes up to this wide are closed",
       "more: fewer holes, with surface that no photograph confirms", MW_FIELD(join.max_hole_steps)},
      {"close-reach", kJoining, "of the photograph's longer side", 0, 1,
       "gaps up to this large are closed where surface surrounds them and no camera looks through; 0: none",
       "more: fewer gaps, with surface that no photograph confirms", MW_FIELD(join.close_reach)},
      {"blend", kJoining, "lattice steps", 0, 1000, "colours run into each other this far from seams",
       "more: seams of exposure are seen less, colours are mixed more", MW_FIELD(join.blend_steps)},
      {"simplify", kJoining, "pixel footprints g", 0, 100,
       "leave out triangles (and the colours at their corners) up to this error; 0: none",
       "more: smaller files, coarser surfaces and colours", MW_FIELD(join.simplify_footprints)},
  };
}

#undef MW_FIELD

}  // namespace

const std::vector<Option>& OptionTable() {
  static const auto* const table = new std::vector<Option>(MakeTable());
  return *table;
}

const std::vector<OptionRelation>& OptionRelations() {
  static const auto* const relations = new std::vector<OptionRelation>{
      {"min-pair-angle", "max-pair-angle", 1, 0},
      // Windows that are solved at the same time must not reach each other.
      {"mrf-margin", "mrf-window", 2, 2},
  };
  return *relations;
}

}  // namespace meshwright
