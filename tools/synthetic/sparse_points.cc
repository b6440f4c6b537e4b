// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "tools/synthetic/hash_noise.h"
#include "tools/synthetic/photographs.h"

namespace meshwright {
namespace {

constexpr int kTriesPerPoint = 30;     // pixels tried for one point before giving up
constexpr double kMinContrast = 9;     // grey levels; what a corner detector needs
constexpr double kMinCosine = 0.34;    // 70 degrees: a surface seen flatter is not recognised
constexpr double kMaxSideways = 0.64;  // cosine of 50 degrees: views from further apart are not matched
constexpr double kSeenShare = 0.8;     // of the possible sightings
constexpr double kNoisePx = 0.3;

// Standard deviation of the grey levels around a pixel.
double Contrast(const ColorImage& image, int column, int row) {
  double sum = 0;
  double squares = 0;
  for (int y = row - 2; y <= row + 2; ++y) {
    for (int x = column - 2; x <= column + 2; ++x) {
      const std::array<uint8_t, 3> rgb = image.At(x, y);
      const double grey = 0.3 * rgb[0] + 0.59 * rgb[1] + 0.11 * rgb[2];
      sum += grey;
      squares += grey * grey;
    }
  }
  return std::sqrt(std::max(0.0, squares / 25 - (sum / 25) * (sum / 25)));
}

// Whether `camera` sees the surface point x with this normal, nothing being in front of it.
bool Sees(const MeshRayCaster& caster, const Camera& camera, const Eigen::Vector3d& x, const Eigen::Vector3d& normal) {
  const Eigen::Vector3d x_in_cam = camera.CamFromWorld(x);
  if (x_in_cam.z() <= 0 || !camera.Contains(camera.ProjectFromCam(x_in_cam), 5)) return false;
  const Eigen::Vector3d center = camera.center_in_world();
  if (normal.dot((center - x).normalized()) < kMinCosine) return false;
  return !caster.IsBlocked(center, x - center, 0, 1 - 2e-3);
}

}  // namespace

std::vector<SparsePoint> FindSparsePoints(const MeshRayCaster& caster, const std::vector<Camera>& cameras,
                                          const std::vector<ColorImage>& images, const SyntheticOptions& options,
                                          ThreadPool& pool) {
  const int per_camera = options.sparse_points_per_camera;
  const auto count = static_cast<int64_t>(cameras.size()) * per_camera;
  std::vector<SparsePoint> candidates(static_cast<size_t>(count));
  pool.ParallelFor(count, 64, [&](int64_t begin, int64_t end) {
    for (int64_t i = begin; i < end; ++i) {
      const auto first = static_cast<size_t>(i / per_camera);
      const Camera& camera = cameras[first];
      const ColorImage& image = images[first];
      HashRandom random(HashBits(options.seed, 301, static_cast<uint64_t>(i)));
      for (int attempt = 0; attempt < kTriesPerPoint; ++attempt) {
        const int column = 5 + random.Index(camera.width - 10);
        const int row = 5 + random.Index(camera.height - 10);
        if (Contrast(image, column, row) < kMinContrast) continue;
        const Eigen::Vector3d center = camera.center_in_world();
        const Eigen::Vector3d ray =
            camera.cam_from_world.rotation.transpose() * camera.RayInCam(column + 0.5, row + 0.5);
        const RayHit hit = caster.Cast(center, ray);
        if (!hit.ok()) continue;
        const Eigen::Vector3d x = center + hit.distance * ray;
        const Eigen::Vector3d normal = caster.FaceNormal(hit.face);
        SparsePoint point;
        for (size_t c = 0; c < cameras.size(); ++c) {
          const Eigen::Vector3d other = cameras[c].center_in_world();
          if ((other - x).normalized().dot((center - x).normalized()) < kMaxSideways) continue;
          if (!Sees(caster, cameras[c], x, normal)) continue;
          if (c == first || random.Uniform(0, 1) < kSeenShare) point.seen_by.push_back(static_cast<CameraIndex>(c));
        }
        if (point.seen_by.size() < std::min<size_t>(3, cameras.size())) continue;
        const double sigma = kNoisePx * hit.distance / camera.focal();
        point.x_in_world = x + sigma * Eigen::Vector3d(random.Normal(), random.Normal(), random.Normal());
        point.rgb = image.At(column, row);
        candidates[static_cast<size_t>(i)] = point;
        break;
      }
    }
  });
  std::erase_if(candidates, [](const SparsePoint& point) { return point.seen_by.empty(); });
  std::sort(candidates.begin(), candidates.end(), [](const SparsePoint& a, const SparsePoint& b) {
    if (a.seen_by != b.seen_by) return a.seen_by < b.seen_by;
    return std::lexicographical_compare(a.x_in_world.begin(), a.x_in_world.end(), b.x_in_world.begin(),
                                        b.x_in_world.end());
  });
  return candidates;
}

}  // namespace meshwright
