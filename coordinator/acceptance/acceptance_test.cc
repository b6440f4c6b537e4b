// SPDX-License-Identifier: Apache-2.0
#include "coordinator/acceptance/acceptance.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "common/geometry/level_of_detail.h"

namespace meshwright {
namespace {

Camera CameraAt(const Eigen::Vector3d& center_in_world, double turn, double focal) {
  Camera camera{.width = 48, .height = 36, .fx = focal, .fy = focal * 1.05, .cx = 23, .cy = 19};
  camera.cam_from_world.rotation = Eigen::AngleAxisd(turn, Eigen::Vector3d(0.3, 1, 0.2).normalized()).matrix();
  camera.cam_from_world.translation = -(camera.cam_from_world.rotation * center_in_world);
  return camera;
}

// Patches near the plane z = 10 of the world, off by up to `noise`, on a share of the rays, linked at random.
PatchLattice RandomSurface(CameraIndex index, const Camera& camera, int step, double noise, std::mt19937& generator) {
  std::uniform_real_distribution<double> uniform(0, 1);
  PatchLattice surface = PatchLattice::Empty(index, camera, step);
  const Eigen::Vector3d center = camera.center_in_world();
  for (int row = 0; row < surface.lattice.rows; ++row) {
    for (int column = 0; column < surface.lattice.columns; ++column) {
      const auto node = static_cast<size_t>(surface.lattice.Index(column, row));
      const Eigen::Vector2d pixel = surface.lattice.Pixel(column, row);
      const double z = (10 - center.z()) / (camera.BackProject(pixel.x(), pixel.y(), 1) - center).z();
      if (uniform(generator) < 0.3) continue;
      surface.depth[node] = static_cast<float>(z * (1 + noise * (2 * uniform(generator) - 1)));
      surface.normal_in_world[node] = {0, 0, -1};
      surface.quality[node] = 0.9F;
      surface.rgb[node] = {1, 2, 3};
    }
  }
  for (int row = 0; row < surface.lattice.rows; ++row) {
    for (int column = 0; column < surface.lattice.columns; ++column) {
      const int64_t node = surface.lattice.Index(column, row);
      if (!surface.HasPatch(node)) continue;
      uint8_t& links = surface.links[static_cast<size_t>(node)];
      if (column + 1 < surface.lattice.columns && surface.HasPatch(node + 1)) links |= PatchLattice::kLinkRight;
      if (row + 1 < surface.lattice.rows && surface.HasPatch(node + surface.lattice.columns)) {
        links |= PatchLattice::kLinkDown;
      }
      if (uniform(generator) < 0.2) links = 0;
    }
  }
  return surface;
}

PatchLattice AtDepth(PatchLattice surface, float depth) {
  std::fill(surface.depth.begin(), surface.depth.end(), depth);
  return surface;
}

PatchLattice AsCamera(PatchLattice surface, CameraIndex index) {
  surface.camera_index = index;
  return surface;
}

// A patch on each ray, all at one depth.
PatchLattice FullSurface(const Camera& camera, float depth, std::mt19937& generator) {
  PatchLattice surface = AtDepth(RandomSurface(0, camera, 1, 0, generator), depth);
  std::fill(surface.quality.begin(), surface.quality.end(), 0.9F);
  return surface;
}

SurfaceLoader LoaderOf(const std::vector<PatchLattice>& surfaces) {
  return [&surfaces](int i) -> absl::StatusOr<std::shared_ptr<const SparseSurface>> {
    return std::make_shared<const SparseSurface>(SparseSurface::From(surfaces[static_cast<size_t>(i)]));
  };
}

// All four nodes around the point's pixel have a surface more than `clearance` behind it.
bool LooksThrough(const PatchLattice& supporter, const Eigen::Vector3d& x, double clearance) {
  const Eigen::Vector3d x_in_cam = supporter.camera.CamFromWorld(x);
  if (x_in_cam.z() <= clearance) return false;
  const Eigen::Vector2d at = supporter.lattice.FromPixel(supporter.camera.ProjectFromCam(x_in_cam));
  const int column = static_cast<int>(std::floor(at.x()));
  const int row = static_cast<int>(std::floor(at.y()));
  for (const auto& [c, r] : {std::pair(0, 0), std::pair(1, 0), std::pair(0, 1), std::pair(1, 1)}) {
    if (!supporter.lattice.Contains(column + c, row + r)) return false;
    const float z = supporter.depth[static_cast<size_t>(supporter.lattice.Index(column + c, row + r))];
    if (z < x_in_cam.z() + clearance) return false;
  }
  return true;
}

// The definition, node against node.
std::vector<bool> SlowAcceptance(const PatchLattice& filtered, const std::vector<PatchLattice>& supporters, int k_a) {
  std::vector<bool> accepted(filtered.depth.size(), false);
  for (int row = 0; row < filtered.lattice.rows; ++row) {
    for (int column = 0; column < filtered.lattice.columns; ++column) {
      const auto node = static_cast<size_t>(filtered.lattice.Index(column, row));
      if (filtered.depth[node] <= 0) continue;
      const Eigen::Vector3d x = filtered.Point(column, row);
      int votes = 0;
      int conflicts = 0;
      for (const PatchLattice& supporter : supporters) {
        const double detail = LevelOfDetail(filtered.camera, filtered.depth[node], filtered.lattice.step);
        const double z = supporter.camera.CamFromWorld(x).z();
        const double coarser = LevelOfDetail(supporter.camera, z, supporter.lattice.step);
        const double radius =
            AcceptanceOptions().support_radius_steps * std::max(detail, std::min(coarser, 2 * detail));
        if (z <= radius) continue;
        bool near = false;
        for (int r = 0; r < supporter.lattice.rows; ++r) {
          for (int c = 0; c < supporter.lattice.columns; ++c) {
            if (!supporter.HasPatch(supporter.lattice.Index(c, r))) continue;
            near = near || (supporter.Point(c, r) - x).norm() <= radius;
          }
        }
        votes += near ? 1 : 0;
        conflicts += !near && LooksThrough(supporter, x, 2 * radius) ? 1 : 0;
      }
      accepted[node] = votes >= k_a && votes > conflicts;
    }
  }
  return accepted;
}

TEST(Acceptance, EqualsTheDefinition) {
  std::mt19937 generator(1);
  ThreadPool one(1);
  ThreadPool three(3);
  std::uniform_real_distribution<double> uniform(-1, 1);
  int64_t accepted = 0;
  int64_t filtered_patches = 0;
  for (int trial = 0; trial < 12; ++trial) {
    const PatchLattice filtered =
        RandomSurface(0, CameraAt({0, 0, 0}, 0, 40), 1 + trial % 3, trial % 2 == 0 ? 0.6 : 0.1, generator);
    std::vector<PatchLattice> supporters;
    for (int i = 1; i <= 4; ++i) {
      const Camera camera = CameraAt({3 * uniform(generator), 3 * uniform(generator), 4 * uniform(generator)},
                                     0.3 * uniform(generator), 30 + 20 * uniform(generator));
      supporters.push_back(RandomSurface(i, camera, 1 + i % 2, 0.1, generator));
    }
    for (int k_a = 1; k_a <= 3; ++k_a) {
      const std::vector<bool> expected = SlowAcceptance(filtered, supporters, k_a);
      const auto result = AcceptSurface(filtered, 4, LoaderOf(supporters), {.k_a = k_a}, one);
      ASSERT_TRUE(result.ok()) << result.status();
      for (size_t node = 0; node < expected.size(); ++node) {
        ASSERT_EQ(result->accepted.depth[node], expected[node] ? filtered.depth[node] : 0) << node;
      }
      EXPECT_EQ(result->patches_accepted, std::count(expected.begin(), expected.end(), true));
      EXPECT_EQ(result->patches_filtered, filtered.CountPatches());
      accepted += result->patches_accepted;
      filtered_patches += result->patches_filtered;
      std::reverse(supporters.begin(), supporters.end());
      const auto reversed = AcceptSurface(filtered, 4, LoaderOf(supporters), {.k_a = k_a}, three);
      EXPECT_EQ(reversed->accepted.depth, result->accepted.depth);
      EXPECT_EQ(reversed->accepted.links, result->accepted.links);
    }
  }
  EXPECT_GT(accepted, filtered_patches / 10) << "the trials must be neither trivial";
  EXPECT_LT(accepted, filtered_patches * 9 / 10) << "nor the other";
}

// Judged by all cameras a filtered surface gives the same patches as if all had been there before: those that were
// accepted stay with them, the others are late.
TEST(Acceptance, JudgedAgainByAllCameras) {
  std::mt19937 generator(5);
  ThreadPool pool(2);
  std::uniform_real_distribution<double> uniform(-1, 1);
  const PatchLattice filtered = RandomSurface(0, CameraAt({0, 0, 0}, 0, 40), 1, 0.4, generator);
  std::vector<PatchLattice> all;
  for (int i = 1; i <= 9; ++i) {
    const Camera camera = CameraAt({uniform(generator), uniform(generator), uniform(generator)}, 0, 40);
    all.push_back(RandomSurface(i, camera, 1, i <= 2 ? 0.4 : 0.02, generator));
  }
  const auto before = AcceptSurface(filtered, 2, LoaderOf(all), {}, pool);
  const auto after = AcceptSurface(filtered, 9, LoaderOf(all), {}, pool);
  const auto judged = JudgeAgain(filtered, before->accepted, 9, LoaderOf(all), {}, pool);
  ASSERT_TRUE(judged.ok()) << judged.status();
  int64_t outvoted = 0;
  for (int64_t node = 0; node < filtered.lattice.nodes(); ++node) {
    const bool was_accepted = before->accepted.HasPatch(node);
    const bool is_accepted = after->accepted.HasPatch(node);
    EXPECT_EQ(judged->kept.HasPatch(node), was_accepted && is_accepted) << node;
    EXPECT_EQ(judged->late.HasPatch(node), !was_accepted && is_accepted) << node;
    outvoted += was_accepted && !is_accepted ? 1 : 0;
  }
  EXPECT_GT(judged->kept.CountPatches(), 0);
  EXPECT_GT(judged->late.CountPatches(), 0);
  EXPECT_GT(outvoted, 0);
}

// Inferred patches wait for the last judgement, ask for a camera that infers or measures the same, and change nothing
// about what was measured.
TEST(Acceptance, InferredPatchesHaveNoSayAboutMeasuredOnes) {
  std::mt19937 generator(7);
  ThreadPool pool(2);
  const Camera camera = CameraAt({0, 0, 0}, 0, 40);
  const PatchLattice wall = FullSurface(camera, 10, generator);
  PatchLattice inferred_wall = wall;
  std::fill(inferred_wall.quality.begin(), inferred_wall.quality.end(), PatchLattice::kInferredQuality);
  const PatchLattice floating = AtDepth(wall, 5);
  const PatchLattice nothing = PatchLattice::Empty(0, camera, 1);
  const int64_t all = wall.CountPatches();
  const int64_t rim = 2 * (wall.lattice.columns + wall.lattice.rows);

  const std::vector<PatchLattice> inferred = {AsCamera(inferred_wall, 1)};
  const std::vector<PatchLattice> measured = {AsCamera(wall, 1)};
  EXPECT_EQ(AcceptSurface(wall, 1, LoaderOf(inferred), {}, pool)->patches_accepted, 0)
      << "no support for a measured one";
  EXPECT_EQ(AcceptSurface(inferred_wall, 1, LoaderOf(measured), {}, pool)->patches_accepted, 0) << "not yet";
  for (const auto& supporters : {inferred, measured}) {
    const auto judged = JudgeAgain(inferred_wall, nothing, 1, LoaderOf(supporters), {}, pool);
    EXPECT_EQ(judged->late.CountInferred(), all);
    EXPECT_EQ(judged->unsupported, 0);
  }
  const auto alone = JudgeAgain(inferred_wall, nothing, 0, LoaderOf({}), {}, pool);
  EXPECT_EQ(alone->late.CountPatches(), 0);
  EXPECT_EQ(alone->unsupported, 0) << "what was inferred in vain is no loss";

  // Whoever only infers a wall does not look through what is before it; who measured it does.
  const std::vector<PatchLattice> one_for_it = {AsCamera(floating, 1), AsCamera(inferred_wall, 2)};
  EXPECT_EQ(AcceptSurface(floating, 2, LoaderOf(one_for_it), {}, pool)->patches_accepted, all);
  PatchLattice inferred_floating = floating;
  std::fill(inferred_floating.quality.begin(), inferred_floating.quality.end(), PatchLattice::kInferredQuality);
  const std::vector<PatchLattice> one_against_it = {AsCamera(inferred_floating, 1), AsCamera(wall, 2)};
  EXPECT_LE(JudgeAgain(inferred_floating, nothing, 2, LoaderOf(one_against_it), {}, pool)->late.CountPatches(), rim);
}

// A linked wall z = 10 that each of several cameras measured with noise of its own.
class MeasuredWalls {
 public:
  MeasuredWalls(double noise_d_r, std::mt19937& generator) {
    std::normal_distribution<double> noise(0, noise_d_r);
    for (int i = 0; i < 6; ++i) {
      PatchLattice wall = RandomSurface(i, CameraAt({0.4 * i - 1, 0.1 * i, 0}, 0, 40), 1, 0, generator);
      for (int64_t node = 0; node < wall.lattice.nodes(); ++node) {
        if (!wall.HasPatch(node)) continue;
        float& depth = wall.depth[static_cast<size_t>(node)];
        depth += static_cast<float>(noise(generator) * LevelOfDetail(wall.camera, depth, 1));
      }
      walls_.push_back(wall);
    }
  }

  std::vector<PatchLattice>& walls() { return walls_; }

  FinalSurface JudgeFirst(int threads = 2) const {
    ThreadPool pool(threads);
    const std::vector<PatchLattice> others(walls_.begin() + 1, walls_.end());
    const PatchLattice nothing = PatchLattice::Empty(0, walls_[0].camera, 1);
    return JudgeAgain(walls_[0], nothing, static_cast<int>(others.size()), LoaderOf(others), {}, pool).value();
  }

  // Root mean square of distances from the wall, of patches that `like` has too.
  static double RmsOff(const PatchLattice& surface, const PatchLattice& like) {
    double sum = 0;
    int64_t count = 0;
    for (int row = 0; row < surface.lattice.rows; ++row) {
      for (int column = 0; column < surface.lattice.columns; ++column) {
        if (!like.HasPatch(like.lattice.Index(column, row))) continue;
        const double off = surface.Point(column, row).z() - 10;
        sum += off * off;
        ++count;
      }
    }
    return std::sqrt(sum / static_cast<double>(count));
  }

 private:
  std::vector<PatchLattice> walls_;
};

// Judged again a patch lies where all cameras measured it on average, so noise becomes less; what all agree on stays.
TEST(Acceptance, JudgedAgainPatchesLieWhereCamerasMeasuredThemOnAverage) {
  std::mt19937 generator(8);
  MeasuredWalls noisy(0.5, generator);
  const FinalSurface judged = noisy.JudgeFirst();
  EXPECT_GT(judged.late.CountPatches(), 500);
  EXPECT_LT(MeasuredWalls::RmsOff(judged.late, judged.late),
            0.6 * MeasuredWalls::RmsOff(noisy.walls()[0], judged.late));
  const FinalSurface one_thread = noisy.JudgeFirst(1);
  EXPECT_EQ(one_thread.late.depth, judged.late.depth);

  MeasuredWalls exact(0, generator);
  EXPECT_LT(MeasuredWalls::RmsOff(exact.JudgeFirst().late, exact.JudgeFirst().late), 1e-4);
}

TEST(Acceptance, NoPatchMovesToAnotherSurfaceOrToWhatWasInferred) {
  std::mt19937 generator(9);
  MeasuredWalls exact(0, generator);
  // The others' second surface lies 4 d_r behind; one camera stays, as the supporter without which nothing is kept.
  for (size_t i = 2; i < exact.walls().size(); ++i) {
    for (float& depth : exact.walls()[i].depth) depth *= 1 + 4.0F / 40;
  }
  const FinalSurface before_another = exact.JudgeFirst();
  EXPECT_GT(before_another.late.CountPatches(), 500);
  EXPECT_LT(MeasuredWalls::RmsOff(before_another.late, before_another.late), 1e-4);

  MeasuredWalls inferred(0, generator);
  for (size_t i = 2; i < inferred.walls().size(); ++i) {
    for (float& depth : inferred.walls()[i].depth) depth *= 1 + 1.0F / 40;
    std::fill(inferred.walls()[i].quality.begin(), inferred.walls()[i].quality.end(), PatchLattice::kInferredQuality);
  }
  const FinalSurface before_inferred = inferred.JudgeFirst();
  EXPECT_GT(before_inferred.late.CountPatches(), 500);
  EXPECT_LT(MeasuredWalls::RmsOff(before_inferred.late, before_inferred.late), 1e-4);
}

TEST(Acceptance, LinksStayWhereBothEndsDo) {
  std::mt19937 generator(2);
  ThreadPool pool(2);
  const PatchLattice filtered = RandomSurface(0, CameraAt({0, 0, 0}, 0, 40), 1, 0.2, generator);
  const std::vector<PatchLattice> supporters = {RandomSurface(1, CameraAt({1, 0, 0}, 0, 40), 1, 0.1, generator)};
  const auto result = AcceptSurface(filtered, 1, LoaderOf(supporters), {}, pool);
  ASSERT_TRUE(result.ok());
  const PatchLattice& accepted = result->accepted;
  const Lattice& lattice = accepted.lattice;
  for (int64_t node = 0; node < lattice.nodes(); ++node) {
    const auto i = static_cast<size_t>(node);
    uint8_t expected = 0;
    if (accepted.HasPatch(node)) {
      EXPECT_EQ(accepted.quality[i], filtered.quality[i]);
      EXPECT_EQ(accepted.rgb[i], filtered.rgb[i]);
      const bool last_column = node % lattice.columns == lattice.columns - 1;
      if (!last_column && accepted.HasPatch(node + 1)) expected |= filtered.links[i] & PatchLattice::kLinkRight;
      if (node + lattice.columns < lattice.nodes() && accepted.HasPatch(node + lattice.columns)) {
        expected |= filtered.links[i] & PatchLattice::kLinkDown;
      }
    } else {
      EXPECT_EQ(accepted.quality[i], 0);
      EXPECT_TRUE(accepted.normal_in_world[i].isZero());
    }
    EXPECT_EQ(accepted.links[i], expected);
  }
}

TEST(Acceptance, WhatMoreCamerasLookThroughThanSupportIsRefused) {
  std::mt19937 generator(6);
  ThreadPool pool(1);
  const Camera camera = CameraAt({0, 0, 0}, 0, 40);
  const PatchLattice wall = FullSurface(camera, 10, generator);
  const PatchLattice floating = AtDepth(wall, 5);
  const std::vector<PatchLattice> one_against_one = {AsCamera(floating, 1), AsCamera(wall, 2)};
  // On the rim of the supporter's lattice there are not four rays around a point, so nothing speaks against it.
  const int64_t rim = 2 * (floating.lattice.columns + floating.lattice.rows);
  EXPECT_LE(AcceptSurface(floating, 2, LoaderOf(one_against_one), {}, pool)->patches_accepted, rim);
  const std::vector<PatchLattice> two_against_one = {AsCamera(floating, 1), AsCamera(wall, 2), AsCamera(floating, 3)};
  EXPECT_GT(AcceptSurface(floating, 3, LoaderOf(two_against_one), {}, pool)->patches_accepted, rim);
  // What lies behind a supporter's surface is hidden from it: no conflict.
  EXPECT_GT(AcceptSurface(wall, 2, LoaderOf(one_against_one), {}, pool)->patches_accepted, rim);
}

TEST(Acceptance, AsksNobodyForAnEmptySurfaceAndPassesErrorsOn) {
  std::mt19937 generator(3);
  ThreadPool pool(1);
  const PatchLattice filtered = RandomSurface(0, CameraAt({0, 0, 0}, 0, 40), 2, 0, generator);
  PatchLattice same = filtered;
  same.camera_index = 1;
  const std::vector<PatchLattice> supporters = {same, same, same};
  const auto result = AcceptSurface(filtered, 3, LoaderOf(supporters), {.k_a = 2}, pool);
  ASSERT_TRUE(result.ok());
  EXPECT_EQ(result->supporters_loaded, 3);
  EXPECT_EQ(result->patches_accepted, result->patches_filtered);
  const auto of_nothing = AcceptSurface(PatchLattice::Empty(0, filtered.camera, 2), 3, LoaderOf(supporters), {}, pool);
  ASSERT_TRUE(of_nothing.ok());
  EXPECT_EQ(of_nothing->supporters_loaded, 0);

  const auto none = AcceptSurface(filtered, 0, LoaderOf(supporters), {}, pool);
  ASSERT_TRUE(none.ok());
  EXPECT_EQ(none->patches_accepted, 0);

  const SurfaceLoader broken = [](int) { return absl::DataLossError("surface 1: truncated"); };
  EXPECT_EQ(AcceptSurface(filtered, 1, broken, {}, pool).status().code(), absl::StatusCode::kDataLoss);
  EXPECT_FALSE(AcceptSurface(filtered, 1, broken, {.k_a = 0}, pool).ok());
  EXPECT_FALSE(AcceptSurface(filtered, 1, broken, {.support_radius_steps = 0}, pool).ok());
}

TEST(Acceptance, PatchesAtOrBehindASupporterGetNoVote) {
  std::mt19937 generator(4);
  ThreadPool pool(1);
  const PatchLattice filtered = RandomSurface(0, CameraAt({0, 0, 0}, 0, 40), 1, 0, generator);
  const std::vector<PatchLattice> supporters = {RandomSurface(1, CameraAt({0, 0, 10}, 0, 40), 1, 0, generator),
                                                RandomSurface(2, CameraAt({0, 0, 30}, 0, 40), 1, 0, generator)};
  EXPECT_EQ(AcceptSurface(filtered, 2, LoaderOf(supporters), {}, pool)->patches_accepted, 0);
}

}  // namespace
}  // namespace meshwright
