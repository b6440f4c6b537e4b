// SPDX-License-Identifier: Apache-2.0
#include "worker/seeding/seeding.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <numbers>
#include <optional>
#include <random>
#include <utility>

#include <Eigen/Geometry>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/geometry/level_of_detail.h"

namespace meshwright {
namespace {

constexpr double kDegree = std::numbers::pi / 180;

// Random but repeatable value at an integer place.
double Hash(int64_t x, int64_t y, uint64_t seed) {
  uint64_t h =
      seed + 0x9E3779B97F4A7C15ULL * static_cast<uint64_t>(x) + 0xC2B2AE3D27D4EB4FULL * static_cast<uint64_t>(y);
  h = (h ^ (h >> 31)) * 0xD6E8FEB86659FD93ULL;
  h = (h ^ (h >> 29)) * 0xA0761D6478BD642FULL;
  return static_cast<double>((h ^ (h >> 32)) % 1000) / 999;
}

// Smooth noise with features of about 1 unit.
double ValueNoise(double u, double v, uint64_t seed) {
  const double fu = std::floor(u);
  const double fv = std::floor(v);
  const auto ease = [](double t) { return t * t * (3 - 2 * t); };
  const double a = ease(u - fu);
  const double b = ease(v - fv);
  const auto x = static_cast<int64_t>(fu);
  const auto y = static_cast<int64_t>(fv);
  return (Hash(x, y, seed) * (1 - a) + Hash(x + 1, y, seed) * a) * (1 - b) +
         (Hash(x, y + 1, seed) * (1 - a) + Hash(x + 1, y + 1, seed) * a) * b;
}

// A textured plane: points origin + u * u_axis + v * v_axis.
struct TexturedPlane {
  Eigen::Vector3d origin;
  Eigen::Vector3d u_axis;  // unit
  Eigen::Vector3d v_axis;  // unit
  double detail = 0.02;    // scene units a texture element
  uint64_t seed = 1;
  double half_width = 1e9;  // |u| beyond which the plane ends

  Eigen::Vector3d normal() const { return u_axis.cross(v_axis).normalized(); }

  // Depth along a world ray of the form center + z * direction, if it hits.
  std::optional<double> Intersect(const Eigen::Vector3d& center, const Eigen::Vector3d& direction) const {
    const double z = normal().dot(origin - center) / normal().dot(direction);
    if (!(z > 0) || std::abs((center + z * direction - origin).dot(u_axis)) > half_width) return std::nullopt;
    return z;
  }
  double Grey(const Eigen::Vector3d& x) const {
    const double u = (x - origin).dot(u_axis) / detail;
    const double v = (x - origin).dot(v_axis) / detail;
    return 0.55 * ValueNoise(u, v, seed) + 0.45 * ValueNoise(0.37 * u, 0.37 * v, seed + 1);
  }
};

Camera LookingAlongZ(const Eigen::Vector3d& center) {
  Camera camera;
  camera.width = 240;
  camera.height = 180;
  camera.fx = 220;
  camera.fy = 220;
  camera.cx = 120;
  camera.cy = 90;
  // Turned to keep the middle of the scene (0, 0, 4) in view.
  const double yaw = std::atan2(center.x(), 4 - center.z());
  camera.cam_from_world.rotation = Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitY()).toRotationMatrix();
  camera.cam_from_world.translation = -(camera.cam_from_world.rotation * center);
  return camera;
}

std::optional<double> DepthAt(const std::vector<TexturedPlane>& planes, const Camera& camera, double x, double y,
                              size_t* which = nullptr) {
  const Eigen::Vector3d direction = camera.cam_from_world.rotation.transpose() * camera.RayInCam(x, y);
  std::optional<double> nearest;
  for (size_t i = 0; i < planes.size(); ++i) {
    const auto z = planes[i].Intersect(camera.center_in_world(), direction);
    if (z && (!nearest || *z < *nearest)) {
      nearest = z;
      if (which != nullptr) *which = i;
    }
  }
  return nearest;
}

ScoredView Render(const std::vector<TexturedPlane>& planes, const Camera& camera) {
  GreyImage grey{camera.width, camera.height, {}};
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      double sum = 0;
      for (const auto& [dx, dy] : {std::pair{0.25, 0.25}, {0.75, 0.25}, {0.25, 0.75}, {0.75, 0.75}}) {
        size_t which = 0;
        const auto z = DepthAt(planes, camera, x + dx, y + dy, &which);
        sum += z ? planes[which].Grey(camera.BackProject(x + dx, y + dy, *z)) : 0.5;
      }
      grey.grey.push_back(static_cast<uint8_t>(20 + 210 * sum / 4));
    }
  }
  return {camera, std::make_shared<SamplingImage>(grey, 3)};
}

PatchScorer MakeScorer(const std::vector<TexturedPlane>& planes, const std::vector<Eigen::Vector3d>& target_centers) {
  std::vector<ScoredView> targets;
  targets.reserve(target_centers.size());
  for (const Eigen::Vector3d& center : target_centers) targets.push_back(Render(planes, LookingAlongZ(center)));
  return {Render(planes, LookingAlongZ({0, 0, 0})), std::move(targets), {}};
}

TexturedPlane FrontalPlane(double z) { return {{0, 0, z}, {1, 0, 0}, {0, 1, 0}}; }

// Turned about the vertical axis.
TexturedPlane SlantedPlane(double slant) { return {{0, 0, 4}, {std::cos(slant), 0, std::sin(slant)}, {0, 1, 0}}; }

// Turned about the horizontal axis: the lower part of the image is nearer.
TexturedPlane Ground(double slant) { return {{0, 0, 4}, {1, 0, 0}, {0, std::cos(slant), -std::sin(slant)}}; }

std::vector<SparsePointObservation> PointsOn(const TexturedPlane& plane, const Camera& reference, int count,
                                             uint32_t seen_by) {
  std::mt19937 random(11);
  std::vector<SparsePointObservation> points;
  for (int i = 0; i < count; ++i) {
    const double x = 10 + static_cast<double>(random() % 2200) / 10;
    const double y = 10 + static_cast<double>(random() % 1600) / 10;
    const auto z = DepthAt({plane}, reference, x, y);
    if (z) points.push_back({reference.BackProject(x, y, *z), seen_by});
  }
  return points;
}

struct Errors {
  int64_t seeds = 0;
  int64_t wrong_depth = 0;   // more than 3 px of detail off
  int64_t wrong_normal = 0;  // more than 20 degrees off
};

Errors Compare(const SeedingResult& result, const std::vector<TexturedPlane>& planes, const Camera& reference,
               const Lattice& lattice) {
  Errors errors;
  for (const Seed& seed : result.seeds) {
    ++errors.seeds;
    const Eigen::Vector2d pixel = lattice.Pixel(seed.node % lattice.columns, seed.node / lattice.columns);
    size_t which = 0;
    const auto z = DepthAt(planes, reference, pixel.x(), pixel.y(), &which);
    if (!z || std::abs(1.0 / seed.plane.w - *z) > LevelOfDetail(reference, *z, 3)) {
      ++errors.wrong_depth;
      continue;
    }
    Eigen::Vector3d normal = reference.cam_from_world.rotation * planes[which].normal();
    if (normal.dot(reference.RayInCam(pixel.x(), pixel.y())) > 0) normal = -normal;
    const double cosine = normal.dot(NormalInCam(reference, pixel.x(), pixel.y(), seed.plane));
    if (cosine < std::cos(20 * kDegree)) ++errors.wrong_normal;
  }
  return errors;
}

// Angle at `x_in_world` between the rays to both cameras, radians.
double ApicalAngle(const Eigen::Vector3d& x_in_world, const Camera& a, const Camera& b) {
  const Eigen::Vector3d to_a = (a.center_in_world() - x_in_world).normalized();
  const Eigen::Vector3d to_b = (b.center_in_world() - x_in_world).normalized();
  return std::atan2(to_a.cross(to_b).norm(), to_a.dot(to_b));
}

void ExpectWellFormed(const SeedingResult& result, const PatchScorer& scorer, const Lattice& lattice) {
  std::vector<int64_t> per_target(static_cast<size_t>(scorer.targets()), 0);
  for (size_t i = 0; i < result.seeds.size(); ++i) {
    const Seed& seed = result.seeds[i];
    ASSERT_GE(seed.node, 0);
    ASSERT_LT(seed.node, lattice.nodes());
    EXPECT_GT(seed.plane.w, 0);
    EXPECT_GE(seed.quality, 0.7F);
    EXPECT_LE(seed.quality, 1.001F);
    EXPECT_NE(seed.sigma, 0U);
    if (i > 0) {
      EXPECT_LE(std::make_pair(result.seeds[i - 1].node, result.seeds[i - 1].plane.w),
                std::make_pair(seed.node, seed.plane.w));
    }
    const int x = lattice.PixelX(seed.node % lattice.columns);
    const int y = lattice.PixelY(seed.node / lattice.columns);
    for (int t = 0; t < scorer.targets(); ++t) {
      if ((seed.sigma >> t & 1U) == 0) continue;
      ++per_target[static_cast<size_t>(t)];
      const Eigen::Vector3d x_in_world = scorer.reference().BackProject(x + 0.5, y + 0.5, 1.0 / seed.plane.w);
      EXPECT_GT(ApicalAngle(x_in_world, scorer.reference(), scorer.target(t).camera), 2.99 * kDegree);
    }
  }
  EXPECT_EQ(per_target, result.seeds_per_target);
  for (size_t t = 0; t < per_target.size(); ++t) EXPECT_GE(result.matches_per_target[t], per_target[t]);
}

TEST(SeedingTest, CornersOfAFrontalPlaneLieOnIt) {
  ThreadPool pool(2);
  const std::vector<TexturedPlane> planes = {FrontalPlane(4)};
  const PatchScorer scorer = MakeScorer(planes, {{0.5, 0, 0}, {-0.6, 0.1, 0.1}});
  for (const int step : {1, 2, 3}) {
    const Lattice lattice = Lattice::For(scorer.reference(), step);
    const SeedingResult result =
        FindSeeds(scorer, {}, AcceptedDepth::Empty(scorer.reference(), step), lattice, {}, pool);
    ExpectWellFormed(result, scorer, lattice);
    const Errors errors = Compare(result, planes, scorer.reference(), lattice);
    EXPECT_GT(errors.seeds, result.corners / 2);
    EXPECT_LE(errors.wrong_depth, errors.seeds / 50);
    EXPECT_LE(errors.wrong_normal, errors.seeds / 6);
    EXPECT_THAT(result.seeds_per_target, testing::Each(testing::Gt(errors.seeds / 2)));
    EXPECT_EQ(result.matches_per_target, result.seeds_per_target);
  }
}

TEST(SeedingTest, OneTargetIsEnoughWhereAMatchHasNoRival) {
  ThreadPool pool(1);
  const std::vector<TexturedPlane> planes = {FrontalPlane(4)};
  const PatchScorer scorer = MakeScorer(planes, {{0.5, 0, 0}});
  const Lattice lattice = Lattice::For(scorer.reference(), 2);
  const SeedingResult result = FindSeeds(scorer, {}, AcceptedDepth::Empty(scorer.reference(), 2), lattice, {}, pool);
  ExpectWellFormed(result, scorer, lattice);
  const Errors errors = Compare(result, planes, scorer.reference(), lattice);
  EXPECT_GT(errors.seeds, 50);
  EXPECT_LE(errors.wrong_depth, errors.seeds / 50);
}

TEST(SeedingTest, SlantedPlanesGetTheRightSlope) {
  ThreadPool pool(2);
  for (const TexturedPlane& plane : {SlantedPlane(60 * kDegree), SlantedPlane(-60 * kDegree), Ground(60 * kDegree)}) {
    const PatchScorer scorer = MakeScorer({plane}, {{0.5, 0, 0}, {-0.5, 0.2, 0}, {0.1, -0.5, 0}});
    const Lattice lattice = Lattice::For(scorer.reference(), 2);
    const SeedingResult result = FindSeeds(scorer, {}, AcceptedDepth::Empty(scorer.reference(), 2), lattice, {}, pool);
    ExpectWellFormed(result, scorer, lattice);
    const Errors errors = Compare(result, {plane}, scorer.reference(), lattice);
    EXPECT_GT(errors.seeds, 60);
    EXPECT_LE(errors.wrong_depth, errors.seeds / 20);
    EXPECT_LE(errors.wrong_normal, errors.seeds / 6);
  }
}

TEST(SeedingTest, PointsOnGrazingGroundBecomeSeedsByTheirNeighbours) {
  ThreadPool pool(1);
  TexturedPlane plane = Ground(78 * kDegree);
  plane.detail = 0.05;
  const PatchScorer scorer = MakeScorer({plane}, {{0.6, 0, 0.2}, {-0.5, 0.1, 0}});
  const Lattice lattice = Lattice::For(scorer.reference(), 2);
  const auto points = PointsOn(plane, scorer.reference(), 300, 3);
  const SeedingResult result =
      FindSeeds(scorer, points, AcceptedDepth::Empty(scorer.reference(), 2), lattice, {}, pool);
  ExpectWellFormed(result, scorer, lattice);
  const Errors errors = Compare(result, {plane}, scorer.reference(), lattice);
  EXPECT_GT(result.seeds_from_points, static_cast<int64_t>(points.size()) / 4);
  EXPECT_LE(errors.wrong_normal, errors.seeds / 6);
}

TEST(SeedingTest, PointsThatAreWrongAreDropped) {
  ThreadPool pool(1);
  const std::vector<TexturedPlane> planes = {FrontalPlane(4)};
  const PatchScorer scorer = MakeScorer(planes, {{0.5, 0, 0}, {-0.5, 0, 0}});
  const Lattice lattice = Lattice::For(scorer.reference(), 2);
  auto points = PointsOn(FrontalPlane(3.2), scorer.reference(), 100, 3);
  points.push_back({{0, 0, -1}, 3});  // behind the camera
  points.push_back({{50, 0, 4}, 3});  // outside the image
  points.push_back({{0, 0, 0}, 3});   // its centre
  const SeedingResult result =
      FindSeeds(scorer, points, AcceptedDepth::Empty(scorer.reference(), 2), lattice, {}, pool);
  EXPECT_LE(result.seeds_from_points, 5);
  EXPECT_GE(result.points_inconsistent, 95);
}

TEST(SeedingTest, NothingIsSeededOnOrBehindTheAcceptedSurface) {
  ThreadPool pool(2);
  TexturedPlane front = FrontalPlane(3);
  front.half_width = 0.5;
  const TexturedPlane back = FrontalPlane(4);
  const std::vector<TexturedPlane> planes = {front, back};
  const PatchScorer scorer = MakeScorer(planes, {{0.5, 0, 0}, {-0.5, 0, 0}});
  const Lattice lattice = Lattice::For(scorer.reference(), 2);
  const auto points = PointsOn(back, scorer.reference(), 200, 3);

  // Where the back plane is accepted on every ray, only the front one is seeded.
  AcceptedDepth accepted = AcceptedDepth::Empty(scorer.reference(), 2);
  accepted.depth.assign(accepted.depth.size(), 4);
  const SeedingResult on_front = FindSeeds(scorer, points, accepted, lattice, {}, pool);
  EXPECT_GT(on_front.seeds.size(), 20U);
  EXPECT_EQ(on_front.points_covered, static_cast<int64_t>(points.size()));
  for (const Seed& seed : on_front.seeds) EXPECT_NEAR(1 / seed.plane.w, 3, 0.1);
  // Corners on the accepted surface still speak for the pairs.
  EXPECT_THAT(on_front.matches_per_target, testing::Each(testing::Gt(100)));
  EXPECT_GT(on_front.corners_covered, 100);

  accepted.depth.assign(accepted.depth.size(), 2.5);
  EXPECT_THAT(FindSeeds(scorer, points, accepted, lattice, {}, pool).seeds, testing::IsEmpty());
}

TEST(SeedingTest, ThreadsAndTheOrderOfPointsDoNotMatter) {
  const TexturedPlane plane = SlantedPlane(40 * kDegree);
  const PatchScorer scorer = MakeScorer({plane}, {{0.5, 0, 0}, {-0.5, 0.2, 0}});
  const Lattice lattice = Lattice::For(scorer.reference(), 2);
  const AcceptedDepth accepted = AcceptedDepth::Empty(scorer.reference(), 2);
  auto points = PointsOn(plane, scorer.reference(), 120, 1);
  ThreadPool one(1);
  const SeedingResult expected = FindSeeds(scorer, points, accepted, lattice, {}, one);
  ASSERT_GT(expected.seeds.size(), 100U);
  std::reverse(points.begin(), points.end());
  ThreadPool three(3);
  const SeedingResult result = FindSeeds(scorer, points, accepted, lattice, {}, three);
  ASSERT_EQ(result.seeds.size(), expected.seeds.size());
  for (size_t i = 0; i < expected.seeds.size(); ++i) {
    const Seed& a = expected.seeds[i];
    const Seed& b = result.seeds[i];
    EXPECT_EQ(a.node, b.node);
    EXPECT_EQ(a.plane.w, b.plane.w);
    EXPECT_EQ(a.plane.gx, b.plane.gx);
    EXPECT_EQ(a.plane.gy, b.plane.gy);
    EXPECT_EQ(a.sigma, b.sigma);
    EXPECT_EQ(a.quality, b.quality);
  }
  EXPECT_EQ(result.seeds_per_target, expected.seeds_per_target);
  EXPECT_EQ(result.seeds_from_points, expected.seeds_from_points);
}

TEST(SeedingTest, WithoutTextureOrTargetsThereIsNothing) {
  ThreadPool pool(1);
  TexturedPlane plane = FrontalPlane(4);
  plane.detail = 1e6;
  const PatchScorer scorer = MakeScorer({plane}, {{0.5, 0, 0}});
  const Lattice lattice = Lattice::For(scorer.reference(), 2);
  const AcceptedDepth accepted = AcceptedDepth::Empty(scorer.reference(), 2);
  const auto points = PointsOn(plane, scorer.reference(), 50, 1);
  EXPECT_THAT(FindSeeds(scorer, points, accepted, lattice, {}, pool).seeds, testing::IsEmpty());

  const PatchScorer alone = MakeScorer({FrontalPlane(4)}, {});
  const SeedingResult result = FindSeeds(alone, points, accepted, lattice, {}, pool);
  EXPECT_THAT(result.seeds, testing::IsEmpty());
  EXPECT_THAT(result.seeds_per_target, testing::IsEmpty());

  // A target at the same place sees no parallax.
  const PatchScorer twin = MakeScorer({FrontalPlane(4)}, {{0.01, 0, 0}});
  EXPECT_THAT(FindSeeds(twin, points, accepted, lattice, {}, pool).seeds, testing::IsEmpty());
}

TEST(SeedingTest, OptionsNameWhatIsWrong) {
  EXPECT_TRUE(SeedingOptions{}.Validate().ok());
  SeedingOptions options;
  options.min_apical_angle_deg = -1;
  EXPECT_THAT(std::string(options.Validate().message()), testing::HasSubstr("min_apical_angle_deg"));
  options = {};
  options.min_seeds_per_pair = -1;
  EXPECT_THAT(std::string(options.Validate().message()), testing::HasSubstr("min_seeds_per_pair"));
  options = {};
  options.min_quality = std::nan("");
  EXPECT_THAT(std::string(options.Validate().message()), testing::HasSubstr("min_quality"));
}

}  // namespace
}  // namespace meshwright
