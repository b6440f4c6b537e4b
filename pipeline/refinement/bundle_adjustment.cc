// SPDX-License-Identifier: Apache-2.0
#include "pipeline/refinement/bundle_adjustment.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>

namespace meshwright {
namespace {

using Matrix6d = Eigen::Matrix<double, 6, 6>;
using Vector6d = Eigen::Matrix<double, 6, 1>;
using Matrix23d = Eigen::Matrix<double, 2, 3>;
using Matrix26d = Eigen::Matrix<double, 2, 6>;

constexpr int kTriangulationSteps = 5;
constexpr int kResectionSteps = 2;
constexpr double kLeastScale = 0.05;  // px
// A Cauchy-like weight falls to a half at this many times the median error.
constexpr double kScaleOfMedian = 2;
constexpr double kDamping = 1e-6;  // of the diagonal
constexpr int64_t kTracksAtOnce = 256;
constexpr int64_t kCamerasAtOnce = 4;

const Eigen::Vector3d kNoPoint = Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN());

double Weight(double squared_error, double scale_px) { return 1 / (1 + squared_error / (scale_px * scale_px)); }

// Of the pixel by the point in the camera's frame.
Matrix23d ProjectionJacobian(const Camera& camera, const Eigen::Vector3d& x_in_cam) {
  const double inverse_z = 1 / x_in_cam.z();
  Matrix23d jacobian;
  jacobian << camera.fx * inverse_z, 0, -camera.fx * x_in_cam.x() * inverse_z * inverse_z,  //
      0, camera.fy * inverse_z, -camera.fy * x_in_cam.y() * inverse_z * inverse_z;
  return jacobian;
}

Eigen::Matrix3d CrossMatrix(const Eigen::Vector3d& v) {
  Eigen::Matrix3d m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

const Camera& CameraOf(const Observation& observation, const std::vector<Camera>& cameras) {
  return cameras[static_cast<size_t>(observation.camera)];
}

// Nearest to all rays in the sense of least squares.
Eigen::Vector3d NearestToRays(std::span<const Observation> track, const std::vector<Camera>& cameras) {
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  for (const Observation& observation : track) {
    const Camera& camera = CameraOf(observation, cameras);
    const Eigen::Vector3d ray =
        (camera.cam_from_world.rotation.transpose() * camera.RayInCam(observation.pixel.x(), observation.pixel.y()))
            .normalized();
    const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - ray * ray.transpose();
    normal += across;
    right += across * camera.center_in_world();
  }
  return normal.ldlt().solve(right);
}

bool InFrontOfAll(const Eigen::Vector3d& x_in_world, std::span<const Observation> track,
                  const std::vector<Camera>& cameras) {
  return x_in_world.allFinite() && std::ranges::all_of(track, [&](const Observation& observation) {
           return CameraOf(observation, cameras).CamFromWorld(x_in_world).z() > 0;
         });
}

// Steps of Gauss and Newton from where the point is.
Eigen::Vector3d Intersect(Eigen::Vector3d x_in_world, std::span<const Observation> track,
                          const std::vector<Camera>& cameras, double scale_px, int steps) {
  for (int step = 0; step < steps; ++step) {
    if (!InFrontOfAll(x_in_world, track, cameras)) return kNoPoint;
    Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
    Eigen::Vector3d right = Eigen::Vector3d::Zero();
    for (const Observation& observation : track) {
      const Camera& camera = CameraOf(observation, cameras);
      const Eigen::Vector3d x_in_cam = camera.CamFromWorld(x_in_world);
      const Eigen::Vector2d error = observation.pixel.cast<double>() - camera.ProjectFromCam(x_in_cam);
      const Matrix23d jacobian = ProjectionJacobian(camera, x_in_cam) * camera.cam_from_world.rotation;
      const double weight = Weight(error.squaredNorm(), scale_px);
      normal += weight * jacobian.transpose() * jacobian;
      right += weight * jacobian.transpose() * error;
    }
    normal.diagonal() *= 1 + kDamping;
    x_in_world += normal.ldlt().solve(right);
  }
  return InFrontOfAll(x_in_world, track, cameras) ? x_in_world : kNoPoint;
}

// Whose points a camera sees, in the order of tracks.
struct Sighting {
  size_t track = 0;
  Eigen::Vector2f pixel = Eigen::Vector2f::Zero();
};

void Resect(Camera& camera, const std::vector<Sighting>& sightings, const std::vector<Eigen::Vector3d>& points,
            double scale_px) {
  for (int step = 0; step < kResectionSteps; ++step) {
    Matrix6d normal = Matrix6d::Zero();
    Vector6d right = Vector6d::Zero();
    for (const Sighting& sighting : sightings) {
      const Eigen::Vector3d& x_in_world = points[sighting.track];
      if (!x_in_world.allFinite()) continue;
      const Eigen::Vector3d x_in_cam = camera.CamFromWorld(x_in_world);
      if (x_in_cam.z() <= 0) continue;
      const Eigen::Vector2d error = sighting.pixel.cast<double>() - camera.ProjectFromCam(x_in_cam);
      const Matrix23d by_point = ProjectionJacobian(camera, x_in_cam);
      Matrix26d jacobian;
      jacobian << -by_point * CrossMatrix(x_in_cam), by_point;
      const double weight = Weight(error.squaredNorm(), scale_px);
      normal += weight * jacobian.transpose() * jacobian;
      right += weight * jacobian.transpose() * error;
    }
    normal.diagonal() *= 1 + kDamping;
    const Vector6d change = normal.ldlt().solve(right);
    if (!change.allFinite()) return;
    const double angle = change.head<3>().norm();
    const Eigen::Quaterniond turn(angle > 0 ? Eigen::AngleAxisd(angle, change.head<3>() / angle)
                                            : Eigen::AngleAxisd::Identity());
    const Eigen::Quaterniond turned = turn * Eigen::Quaterniond(camera.cam_from_world.rotation);
    camera.cam_from_world = {turned.normalized().toRotationMatrix(),
                             turn * camera.cam_from_world.translation + change.tail<3>()};
  }
}

std::vector<float> Errors(const Tracks& tracks, const std::vector<Eigen::Vector3d>& points,
                          const std::vector<Camera>& cameras) {
  std::vector<float> errors;
  for (size_t track = 0; track < tracks.size(); ++track) {
    if (!points[track].allFinite()) continue;
    for (const Observation& observation : tracks.Of(track)) {
      const Camera& camera = CameraOf(observation, cameras);
      const Eigen::Vector3d x_in_cam = camera.CamFromWorld(points[track]);
      if (x_in_cam.z() <= 0) continue;
      errors.push_back(static_cast<float>((observation.pixel.cast<double>() - camera.ProjectFromCam(x_in_cam)).norm()));
    }
  }
  return errors;
}

double Median(std::vector<float> values) {
  if (values.empty()) return std::numeric_limits<double>::quiet_NaN();
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::ranges::nth_element(values, middle);
  return *middle;
}

std::vector<Eigen::Vector3d> TriangulateAll(const Tracks& tracks, const std::vector<Camera>& cameras, double scale_px,
                                            ThreadPool& pool) {
  std::vector<Eigen::Vector3d> points(tracks.size());
  pool.ParallelFor(static_cast<int64_t>(tracks.size()), kTracksAtOnce, [&](int64_t begin, int64_t end) {
    for (auto i = static_cast<size_t>(begin); i < static_cast<size_t>(end); ++i) {
      points[i] = Triangulate(tracks.Of(i), cameras, scale_px);
    }
  });
  return points;
}

}  // namespace

void Tracks::Add(std::span<const Observation> observations) {
  observations_.insert(observations_.end(), observations.begin(), observations.end());
  begins_.push_back(observations_.size());
}

Eigen::Vector3d Triangulate(std::span<const Observation> track, const std::vector<Camera>& cameras, double scale_px) {
  return Intersect(NearestToRays(track, cameras), track, cameras, scale_px, kTriangulationSteps);
}

double MedianError(const Tracks& tracks, const std::vector<Camera>& cameras, ThreadPool& pool) {
  return Median(Errors(tracks, TriangulateAll(tracks, cameras, 1, pool), cameras));
}

std::vector<Camera> AdjustBundle(std::vector<Camera> cameras, const Tracks& tracks,
                                 const BundleAdjustmentOptions& options, ThreadPool& pool) {
  std::vector<std::vector<Sighting>> sightings(cameras.size());
  for (size_t track = 0; track < tracks.size(); ++track) {
    for (const Observation& observation : tracks.Of(track)) {
      sightings[static_cast<size_t>(observation.camera)].push_back({track, observation.pixel});
    }
  }
  std::vector<Eigen::Vector3d> points = TriangulateAll(tracks, cameras, 1, pool);
  double error = Median(Errors(tracks, points, cameras));
  for (int sweep = 0; sweep < options.max_sweeps && std::isfinite(error); ++sweep) {
    const double scale_px = std::max(kLeastScale, kScaleOfMedian * error);
    pool.ParallelFor(static_cast<int64_t>(cameras.size()), kCamerasAtOnce, [&](int64_t begin, int64_t end) {
      for (auto i = static_cast<size_t>(begin); i < static_cast<size_t>(end); ++i) {
        if (sightings[i].size() >= static_cast<size_t>(options.min_observations)) {
          Resect(cameras[i], sightings[i], points, scale_px);
        }
      }
    });
    points = TriangulateAll(tracks, cameras, scale_px, pool);
    const double now = Median(Errors(tracks, points, cameras));
    const bool has_ended = now > (1 - options.least_gain) * error;
    error = now;
    if (has_ended) break;
  }
  return cameras;
}

}  // namespace meshwright
