// SPDX-License-Identifier: Apache-2.0
#include "pipeline/refinement/bundle_adjustment.h"

#include <cmath>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "tools/synthetic/hash_noise.h"

namespace meshwright {
namespace {

constexpr int kCameras = 9;
constexpr int kPoints = 400;

Eigen::Matrix3d Turn(const Eigen::Vector3d& angles) {
  return angles.isZero(0) ? Eigen::Matrix3d::Identity()
                          : Eigen::AngleAxisd(angles.norm(), angles.normalized()).toRotationMatrix();
}

// Cameras on an arc around points in a ball, and what they see of them.
struct Arc {
  std::vector<Camera> cameras;  // that took the photographs
  std::vector<Eigen::Vector3d> points;
  Tracks tracks;
};

Arc MakeArc(double noise_px, double share_wrong = 0) {
  Arc arc;
  HashRandom random(7);
  for (int i = 0; i < kCameras; ++i) {
    const double angle = 0.15 * (i - kCameras / 2);
    Camera camera{.width = 640, .height = 480, .fx = 600, .fy = 600, .cx = 320, .cy = 240, .cam_from_world = {}};
    camera.cam_from_world.rotation = Turn({0.05 * (i % 3), angle, 0.02 * i});
    camera.cam_from_world.translation = Eigen::Vector3d(0, 0, 5);
    arc.cameras.push_back(camera);
  }
  for (int i = 0; i < kPoints; ++i) {
    arc.points.push_back({random.Uniform(-1, 1), random.Uniform(-1, 1), random.Uniform(-1, 1)});
    std::vector<Observation> track;
    const int first = random.Index(kCameras - 3);
    for (int k = 0; k < 4; ++k) {
      const auto camera = static_cast<CameraIndex>(first + k);
      Eigen::Vector2d pixel = arc.cameras[static_cast<size_t>(camera)].ProjectFromCam(
          arc.cameras[static_cast<size_t>(camera)].CamFromWorld(arc.points.back()));
      pixel += noise_px * Eigen::Vector2d(random.Normal(), random.Normal());
      if (random.Uniform(0, 1) < share_wrong) pixel += Eigen::Vector2d(random.Uniform(-9, 9), random.Uniform(-9, 9));
      track.push_back({camera, pixel.cast<float>()});
    }
    arc.tracks.Add(track);
  }
  return arc;
}

// As somebody else's program may have them: turned by about so many pixels, and shifted by as much.
std::vector<Camera> Disturbed(std::vector<Camera> cameras, double off_px) {
  HashRandom random(11);
  for (Camera& camera : cameras) {
    const double angle = off_px / camera.fx;
    const auto any = [&] { return Eigen::Vector3d(random.Normal(), random.Normal(), random.Normal()); };
    camera.cam_from_world.rotation = Turn(angle * any()) * camera.cam_from_world.rotation;
    camera.cam_from_world.translation += 5 * angle * any();
  }
  return cameras;
}

TEST(BundleAdjustment, ExactCamerasStay) {
  ThreadPool pool(2);
  const Arc arc = MakeArc(0);
  const std::vector<Camera> adjusted = AdjustBundle(arc.cameras, arc.tracks, {}, pool);
  for (size_t i = 0; i < adjusted.size(); ++i) {
    EXPECT_TRUE(adjusted[i].cam_from_world.rotation.isApprox(arc.cameras[i].cam_from_world.rotation, 1e-5));
    EXPECT_LT((adjusted[i].center_in_world() - arc.cameras[i].center_in_world()).norm(), 1e-4);
  }
}

TEST(BundleAdjustment, WrongCamerasComeToAgree) {
  ThreadPool pool(2);
  for (const double off_px : {0.5, 2.0, 6.0}) {
    const Arc arc = MakeArc(0);
    const std::vector<Camera> given = Disturbed(arc.cameras, off_px);
    const double before = MedianError(arc.tracks, given, pool);
    EXPECT_GT(before, 0.3 * off_px);
    EXPECT_LT(MedianError(arc.tracks, AdjustBundle(given, arc.tracks, {}, pool), pool), 0.1 * before) << off_px;
  }
}

TEST(BundleAdjustment, WrongObservationsHaveLittleSay) {
  ThreadPool pool(2);
  const Arc arc = MakeArc(0.1, 0.15);
  const std::vector<Camera> given = Disturbed(arc.cameras, 1);
  const std::vector<Camera> adjusted = AdjustBundle(given, arc.tracks, {}, pool);
  const Arc clean = MakeArc(0);
  EXPECT_LT(MedianError(clean.tracks, adjusted, pool), 0.15 * MedianError(clean.tracks, given, pool));
}

TEST(BundleAdjustment, ThreadsHaveNoInfluence) {
  ThreadPool one(1);
  ThreadPool three(3);
  const Arc arc = MakeArc(0.2, 0.1);
  const std::vector<Camera> given = Disturbed(arc.cameras, 1);
  const std::vector<Camera> by_one = AdjustBundle(given, arc.tracks, {}, one);
  const std::vector<Camera> by_three = AdjustBundle(given, arc.tracks, {}, three);
  for (size_t i = 0; i < by_one.size(); ++i) {
    EXPECT_EQ(by_one[i].cam_from_world.rotation, by_three[i].cam_from_world.rotation);
    EXPECT_EQ(by_one[i].cam_from_world.translation, by_three[i].cam_from_world.translation);
  }
}

TEST(BundleAdjustment, CamerasThatFewPointsHoldStay) {
  ThreadPool pool(1);
  const Arc arc = MakeArc(0);
  const std::vector<Camera> given = Disturbed(arc.cameras, 1);
  const std::vector<Camera> adjusted = AdjustBundle(given, arc.tracks, {.min_observations = 10'000}, pool);
  EXPECT_EQ(adjusted[3].cam_from_world.rotation, given[3].cam_from_world.rotation);
  // Nothing at all to go by.
  EXPECT_EQ(AdjustBundle(given, Tracks(), {}, pool)[3].cam_from_world.rotation, given[3].cam_from_world.rotation);
  EXPECT_TRUE(std::isnan(MedianError(Tracks(), given, pool)));
}

TEST(Triangulate, RaysThatPartMeetNowhere) {
  const Arc arc = MakeArc(0);
  const std::vector<Observation> track = {{2, {600, 240}}, {6, {20, 240}}};
  const Eigen::Vector3d point = Triangulate(track, arc.cameras, 1);
  const std::vector<Observation> swapped = {{2, {20, 240}}, {6, {600, 240}}};
  EXPECT_NE(point.allFinite(), Triangulate(swapped, arc.cameras, 1).allFinite());
}

// The slow twin: all cameras and points in one system of equations (Levenberg and Marquardt), the first camera and one
// length held.
double ErrorByOneSystem(const Arc& arc, std::vector<Camera> cameras) {
  std::vector<Eigen::Vector3d> points;
  for (size_t i = 0; i < arc.tracks.size(); ++i) points.push_back(Triangulate(arc.tracks.Of(i), cameras, 1e6));
  const auto unknowns = static_cast<Eigen::Index>(6 * cameras.size() + 3 * points.size());
  const auto rows = static_cast<Eigen::Index>(2 * arc.tracks.observations());
  const auto moved = [&](const std::vector<Camera>& from, const Eigen::VectorXd& change) {
    std::vector<Camera> to = from;
    for (size_t i = 0; i < to.size(); ++i) {
      const auto at = static_cast<Eigen::Index>(6 * i);
      to[i].cam_from_world.rotation = Turn(change.segment<3>(at)) * to[i].cam_from_world.rotation;
      to[i].cam_from_world.translation =
          Turn(change.segment<3>(at)) * to[i].cam_from_world.translation + change.segment<3>(at + 3);
    }
    return to;
  };
  const auto errors = [&](const std::vector<Camera>& of, const std::vector<Eigen::Vector3d>& at) {
    Eigen::VectorXd all(rows);
    Eigen::Index row = 0;
    for (size_t i = 0; i < at.size(); ++i) {
      for (const Observation& observation : arc.tracks.Of(i)) {
        const Camera& camera = of[static_cast<size_t>(observation.camera)];
        all.segment<2>(row) = observation.pixel.cast<double>() - camera.ProjectFromCam(camera.CamFromWorld(at[i]));
        row += 2;
      }
    }
    return all;
  };
  for (int step = 0; step < 4; ++step) {
    const Eigen::VectorXd error = errors(cameras, points);
    Eigen::MatrixXd jacobian = Eigen::MatrixXd::Zero(rows, unknowns);
    constexpr double kDelta = 1e-6;
    for (Eigen::Index column = 0; column < unknowns; ++column) {
      Eigen::VectorXd change = Eigen::VectorXd::Zero(unknowns);
      change[column] = kDelta;
      std::vector<Eigen::Vector3d> points_there = points;
      const auto first_of_points = static_cast<Eigen::Index>(6 * cameras.size());
      if (column >= first_of_points) {
        const Eigen::Index k = column - first_of_points;
        points_there[static_cast<size_t>(k / 3)][k % 3] += kDelta;
      }
      jacobian.col(column) = (error - errors(moved(cameras, change), points_there)) / kDelta;
    }
    Eigen::MatrixXd normal = jacobian.transpose() * jacobian;
    normal.diagonal().array() *= 1 + 1e-4;
    normal.diagonal().array() += 1e-6;
    const Eigen::VectorXd change = normal.ldlt().solve(jacobian.transpose() * error);
    for (size_t i = 0; i < points.size(); ++i) {
      points[i] += change.segment<3>(static_cast<Eigen::Index>(6 * cameras.size() + 3 * i));
    }
    cameras = moved(cameras, change);
  }
  return std::sqrt(errors(cameras, points).squaredNorm() / static_cast<double>(arc.tracks.observations()));
}

TEST(BundleAdjustment, AsGoodAsOneSystemOfEquations) {
  ThreadPool pool(2);
  Arc arc = MakeArc(0.3);
  Tracks fewer;
  for (size_t i = 0; i < 60; ++i) fewer.Add(arc.tracks.Of(i));
  arc.tracks = fewer;
  const std::vector<Camera> given = Disturbed(arc.cameras, 1);
  const std::vector<Camera> adjusted = AdjustBundle(given, arc.tracks, {.min_observations = 5}, pool);
  double sum = 0;
  for (size_t i = 0; i < arc.tracks.size(); ++i) {
    const Eigen::Vector3d point = Triangulate(arc.tracks.Of(i), adjusted, 1e6);
    for (const Observation& observation : arc.tracks.Of(i)) {
      const Camera& camera = adjusted[static_cast<size_t>(observation.camera)];
      sum += (observation.pixel.cast<double>() - camera.ProjectFromCam(camera.CamFromWorld(point))).squaredNorm();
    }
  }
  const double error = std::sqrt(sum / static_cast<double>(arc.tracks.observations()));
  EXPECT_LT(error, 1.15 * ErrorByOneSystem(arc, given));
}

}  // namespace
}  // namespace meshwright
