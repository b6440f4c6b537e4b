// SPDX-License-Identifier: Apache-2.0
#include "pipeline/texturing/face_views.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include <Eigen/Geometry>
#include <Eigen/LU>

namespace meshwright {
namespace {

constexpr int64_t kFacesAtOnce = 2048;
constexpr double kBorderPixels = 2;
constexpr double kGoodCosine = 0.2588;  // 75 degrees
constexpr double kMinCosine = 0.0872;   // 85 degrees
// Of a face at a grazing angle or beside a silhouette: photographs without such trouble are preferred to any with.
constexpr double kTroubled = 0.5;
constexpr double kMinVisible = 0.5;
constexpr double kFlatGradient = 1;  // grey levels / px that count where there is no texture
// What stands before a face is another surface only if it is this much nearer, in footprints; concave corners are not.
constexpr double kDepthStep = 8;
constexpr double kVisibleSlack = 0.05 * 255;
// Of outlier removal, as in section 4.2.
constexpr int kOutlierRounds = 10;
constexpr size_t kFewestForOutliers = 4;
constexpr double kMinDensity = 6e-3;
constexpr double kSmallVariance = 5e-4 * 255 * 255;

// Magnitude of Sobel's gradient, grey levels / px.
std::vector<float> GradientMagnitude(const ColorImage& image, ThreadPool& pool) {
  const GreyImage grey = ToGrey(image);
  std::vector<float> magnitude(grey.grey.size(), 0.0F);
  pool.ParallelFor(image.height, 32, [&](int64_t begin, int64_t end) {
    for (int y = std::max(1, static_cast<int>(begin)); y < std::min(image.height - 1, static_cast<int>(end)); ++y) {
      for (int x = 1; x < image.width - 1; ++x) {
        const auto at = [&](int dx, int dy) { return static_cast<float>(grey.At(x + dx, y + dy)); };
        const float gx = at(1, -1) + 2 * at(1, 0) + at(1, 1) - at(-1, -1) - 2 * at(-1, 0) - at(-1, 1);
        const float gy = at(-1, 1) + 2 * at(0, 1) + at(1, 1) - at(-1, -1) - 2 * at(0, -1) - at(1, -1);
        magnitude[static_cast<size_t>(y) * static_cast<size_t>(image.width) + static_cast<size_t>(x)] =
            std::sqrt(gx * gx + gy * gy) / 8;
      }
    }
  });
  return magnitude;
}

// Looks at faces in one photograph.
class FaceExaminer {
 public:
  FaceExaminer(const TriangleMesh& mesh, const DepthRaster& raster, CameraIndex camera, const ColorImage& image,
               const IgnoredPixels& ignored, const std::vector<float>& gradient)
      : mesh_(mesh),
        raster_(raster),
        camera_(camera),
        image_(image),
        ignored_(ignored),
        gradient_(gradient),
        center_(raster.camera().center_in_world()) {}

  std::optional<FaceView> Examine(const std::array<uint32_t, 3>& face) const {
    if (!raster_.IsInFront(face)) return std::nullopt;
    for (const uint32_t v : face) {
      if (!raster_.camera().Contains(raster_.Pixel(v), kBorderPixels)) return std::nullopt;
    }
    const Eigen::Vector3d a = mesh_.positions[face[0]].cast<double>();
    const Eigen::Vector3d b = mesh_.positions[face[1]].cast<double>();
    const Eigen::Vector3d c = mesh_.positions[face[2]].cast<double>();
    const Eigen::Vector3d normal = (b - a).cross(c - a);
    const Eigen::Vector3d towards_camera = center_ - (a + b + c) / 3;
    if (!(normal.dot(towards_camera) > kMinCosine * normal.norm() * towards_camera.norm())) return std::nullopt;
    const ImageTriangle triangle = raster_.Triangle(face);
    if (!(triangle.area() > 0)) return std::nullopt;
    const bool grazing = normal.dot(towards_camera) < kGoodCosine * normal.norm() * towards_camera.norm();
    return Measure(face, triangle, grazing);
  }

 private:
  struct Sums {
    double pixels = 0;
    bool ignored = false;
    double visible = 0;
    double clear = 0;  // visible, and no silhouette near
    double gradient = 0;
    Eigen::Vector3d color = Eigen::Vector3d::Zero();
  };

  std::optional<FaceView> Measure(const std::array<uint32_t, 3>& face, const ImageTriangle& triangle,
                                  bool grazing) const {
    // How far the plane of the face is from its depth a pixel away.
    const Eigen::Vector2d origin = raster_.Pixel(face[0]);
    const double at_origin = 1 / raster_.Depth(face[0]);
    const double slope =
        std::abs(raster_.InverseDepth(face, triangle.Weights(origin + Eigen::Vector2d::UnitX())) - at_origin) +
        std::abs(raster_.InverseDepth(face, triangle.Weights(origin + Eigen::Vector2d::UnitY())) - at_origin);
    // d(1 / z) of a footprint z / f is 1 / (f z).
    const double step = kDepthStep * at_origin / raster_.camera().focal() + (DepthRaster::kReach + 1) * slope;
    Sums sums;
    const auto add = [&](int x, int y, double inverse_depth) {
      const auto i = static_cast<size_t>(y) * static_cast<size_t>(image_.width) + static_cast<size_t>(x);
      sums.pixels += 1;
      sums.ignored = sums.ignored || ignored_.At(x, y);
      if (raster_.NearestInverseDepth(x, y) < inverse_depth + step) sums.visible += 1;
      if (raster_.NearestAround(x, y) < inverse_depth + step) sums.clear += 1;
      sums.gradient += gradient_[i];
      for (size_t k = 0; k < 3; ++k) sums.color[static_cast<Eigen::Index>(k)] += image_.rgb[3 * i + k];
    };
    triangle.ForEachPixel({0, 0, image_.width, image_.height}, [&](int x, int y, const Eigen::Vector3d& weights) {
      add(x, y, raster_.InverseDepth(face, weights));
    });
    if (sums.pixels == 0) {  // smaller than a pixel
      const Eigen::Vector2d middle = (raster_.Pixel(face[0]) + raster_.Pixel(face[1]) + raster_.Pixel(face[2])) / 3;
      add(static_cast<int>(middle.x()), static_cast<int>(middle.y()),
          raster_.InverseDepth(face, Eigen::Vector3d::Constant(1.0 / 3)));
    }
    if (sums.ignored || sums.visible < kMinVisible * sums.pixels) return std::nullopt;
    FaceView view;
    view.camera = camera_;
    view.quality = static_cast<float>(triangle.area() * (sums.gradient / sums.pixels + kFlatGradient));
    const bool is_clear = !grazing && sums.clear >= kMinVisible * sums.pixels;
    view.visible = static_cast<uint8_t>(255 * (is_clear ? sums.clear : kTroubled * sums.visible) / sums.pixels);
    for (size_t k = 0; k < 3; ++k) {
      view.color[k] = static_cast<uint8_t>(sums.color[static_cast<Eigen::Index>(k)] / sums.pixels + 0.5);
    }
    return view;
  }

  const TriangleMesh& mesh_;
  const DepthRaster& raster_;
  const CameraIndex camera_;
  const ColorImage& image_;
  const IgnoredPixels& ignored_;
  const std::vector<float>& gradient_;
  const Eigen::Vector3d center_;
};

Eigen::Vector3d ColorOf(const FaceView& view) {
  return {view.color[0] * 1.0, view.color[1] * 1.0, view.color[2] * 1.0};
}

// Which of the views agree with each other in colour: a normal distribution is fitted to those that do, until nothing
// changes. All of them where that cannot be told.
std::vector<bool> FindInliers(absl::Span<const FaceView> views) {
  std::vector<bool> inliers(views.size(), true);
  if (views.size() < kFewestForOutliers) return inliers;
  const std::vector<bool> all = inliers;
  for (int round = 0; round < kOutlierRounds; ++round) {
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    double count = 0;
    for (size_t i = 0; i < views.size(); ++i) {
      if (!inliers[i]) continue;
      mean += ColorOf(views[i]);
      count += 1;
    }
    if (count < kFewestForOutliers) return all;
    mean /= count;
    Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
    for (size_t i = 0; i < views.size(); ++i) {
      const Eigen::Vector3d difference = ColorOf(views[i]) - mean;
      if (inliers[i]) covariance += difference * difference.transpose() / (count - 1);
    }
    if (covariance.cwiseAbs().maxCoeff() < kSmallVariance) return inliers;
    covariance += Eigen::Matrix3d::Identity();  // rounding of the colours
    const Eigen::Matrix3d inverse = covariance.inverse();
    std::vector<bool> next(views.size());
    for (size_t i = 0; i < views.size(); ++i) {
      const Eigen::Vector3d difference = ColorOf(views[i]) - mean;
      next[i] = std::exp(-0.5 * difference.dot(inverse * difference)) >= kMinDensity;
    }
    if (next == inliers) return inliers;
    inliers = next;
  }
  return inliers;
}

}  // namespace

void FaceViews::Add(size_t face, const FaceView& view) {
  FaceView* const first = &views_[face * kMost];
  uint8_t& count = counts_[face];
  const auto rank = [](const FaceView& v) { return v.quality * static_cast<float>(v.visible); };
  if (count == kMost && rank(first[kMost - 1]) >= rank(view)) return;
  size_t place = count < kMost ? count++ : kMost - 1;
  for (; place > 0 && rank(first[place - 1]) < rank(view); --place) first[place] = first[place - 1];
  first[place] = view;
}

void FaceViews::AddPhotograph(const TriangleMesh& mesh, const DepthRaster& raster, CameraIndex camera,
                              const ColorImage& image, const IgnoredPixels& ignored, ThreadPool& pool) {
  const std::vector<float> gradient = GradientMagnitude(image, pool);
  const FaceExaminer examiner(mesh, raster, camera, image, ignored, gradient);
  pool.ParallelFor(static_cast<int64_t>(faces()), kFacesAtOnce, [&](int64_t begin, int64_t end) {
    for (auto f = static_cast<size_t>(begin); f < static_cast<size_t>(end); ++f) {
      if (const std::optional<FaceView> view = examiner.Examine(mesh.faces[f])) Add(f, *view);
    }
  });
}

void FaceViews::RemoveOutliers(ThreadPool& pool) {
  pool.ParallelFor(static_cast<int64_t>(faces()), kFacesAtOnce, [&](int64_t begin, int64_t end) {
    for (auto f = static_cast<size_t>(begin); f < static_cast<size_t>(end); ++f) {
      FaceView* const first = &views_[f * kMost];
      uint8_t most_visible = 0;
      for (const FaceView& view : Of(f)) most_visible = std::max(most_visible, view.visible);
      FaceView* last = std::remove_if(
          first, first + counts_[f], [&](const FaceView& view) { return view.visible < most_visible - kVisibleSlack; });
      const std::vector<bool> inliers = FindInliers({first, static_cast<size_t>(last - first)});
      size_t kept = 0;
      for (size_t i = 0; i < inliers.size(); ++i) {
        if (inliers[i]) first[kept++] = first[i];
      }
      counts_[f] = static_cast<uint8_t>(kept);
    }
  });
}

}  // namespace meshwright
