// SPDX-License-Identifier: Apache-2.0
#include "worker/photo_consistency/patch_scorer.h"

#include <cmath>
#include <optional>
#include <random>
#include <set>

#include <Eigen/Geometry>
#include <gtest/gtest.h>
#include <hwy/highway.h>

namespace meshwright {
namespace {

GreyImage Noise(int width, int height, uint32_t seed) {
  std::mt19937 generator(seed);
  std::vector<double> values(static_cast<size_t>(width) * static_cast<size_t>(height));
  for (double& value : values) value = static_cast<double>(generator() % 256);
  GreyImage image{width, height, std::vector<uint8_t>(values.size())};
  // Smoothed, so that interpolation is meaningful.
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      double sum = 0;
      int count = 0;
      for (int j = std::max(0, y - 1); j <= std::min(height - 1, y + 1); ++j) {
        for (int i = std::max(0, x - 1); i <= std::min(width - 1, x + 1); ++i) {
          sum += values[static_cast<size_t>(j * width + i)];
          ++count;
        }
      }
      image.grey[static_cast<size_t>(y * width + x)] = static_cast<uint8_t>(sum / count);
    }
  }
  return image;
}

Camera MakeCamera(int width, int height, const Eigen::Vector3d& center, double yaw) {
  Camera camera{.width = width, .height = height, .fx = 200, .fy = 205, .cx = width / 2.0 + 3, .cy = height / 2.0 - 2};
  camera.cam_from_world.rotation = Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitY()).toRotationMatrix();
  camera.cam_from_world.translation = -(camera.cam_from_world.rotation * center);
  return camera;
}

double Bilinear(const GreyImage& image, double x, double y) {
  const int column = static_cast<int>(std::floor(x - 0.5));
  const int row = static_cast<int>(std::floor(y - 0.5));
  const double fx = x - 0.5 - column;
  const double fy = y - 0.5 - row;
  return (1 - fy) * ((1 - fx) * image.At(column, row) + fx * image.At(column + 1, row)) +
         fy * ((1 - fx) * image.At(column, row + 1) + fx * image.At(column + 1, row + 1));
}

// The definition, written down in double precision: every pixel of the window goes to the plane and into the target.
std::optional<double> SlowScore(const GreyImage& reference_image, const Camera& reference,
                                const GreyImage& target_image, const Camera& target, int x, int y,
                                const PatchPlane& plane, int radius) {
  std::vector<double> r;
  std::vector<double> t;
  std::vector<double> weights;
  for (int dy = -radius; dy <= radius; ++dy) {
    for (int dx = -radius; dx <= radius; ++dx) {
      const double inverse_depth = plane.w + plane.gx * dx + plane.gy * dy;
      const Eigen::Vector3d x_in_world = reference.BackProject(x + dx + 0.5, y + dy + 0.5, 1 / inverse_depth);
      const Eigen::Vector3d x_in_target = target.CamFromWorld(x_in_world);
      const Eigen::Vector2d pixel = target.ProjectFromCam(x_in_target);
      if (inverse_depth <= 0 || x_in_target.z() <= 0 || !target.Contains(pixel, 0.6)) return std::nullopt;
      r.push_back(reference_image.At(x + dx, y + dy));
      t.push_back(Bilinear(target_image, pixel.x(), pixel.y()));
      weights.push_back(
          std::exp(-std::abs(r.back() - reference_image.At(x, y)) / PatchScorer::Options{}.similarity_scale));
    }
  }
  double n = 0;
  double mean_r = 0;
  double mean_t = 0;
  for (size_t i = 0; i < r.size(); ++i) {
    n += weights[i];
    mean_r += weights[i] * r[i];
    mean_t += weights[i] * t[i];
  }
  mean_r /= n;
  mean_t /= n;
  double rr = 0;
  double tt = 0;
  double rt = 0;
  for (size_t i = 0; i < r.size(); ++i) {
    rr += weights[i] * (r[i] - mean_r) * (r[i] - mean_r);
    tt += weights[i] * (t[i] - mean_t) * (t[i] - mean_t);
    rt += weights[i] * (r[i] - mean_r) * (t[i] - mean_t);
  }
  // Nearly no texture left under the weights: rounding decides.
  if (rr < n || tt < n) return std::nullopt;
  return rt / std::sqrt(rr * tt);
}

struct TwoViews {
  GreyImage reference_image = Noise(120, 100, 1);
  GreyImage target_image = Noise(140, 110, 2);
  Camera reference = MakeCamera(120, 100, {0, 0, 0}, 0);
  Camera target = MakeCamera(140, 110, {0.4, 0.05, 0.1}, 0.15);

  PatchScorer Scorer(int radius, int levels = 1) const {
    return PatchScorer({reference, std::make_shared<SamplingImage>(reference_image, 1)},
                       {{target, std::make_shared<SamplingImage>(target_image, levels)}}, {.window_radius = radius});
  }
};

TEST(PatchScorer, EqualsItsDefinition) {
  const TwoViews views;
  std::mt19937 generator(3);
  std::uniform_real_distribution<float> uniform(-1, 1);
  int compared = 0;
  for (const int radius : {1, 2, 3, 4, 5, 7}) {
    const PatchScorer scorer = views.Scorer(radius);
    for (int i = 0; i < 300; ++i) {
      const int x = static_cast<int>(generator() % 120);
      const int y = static_cast<int>(generator() % 100);
      const PatchPlane plane{0.4F + 0.2F * uniform(generator), 0.004F * uniform(generator),
                             0.004F * uniform(generator)};
      PatchScorer::Window window;
      scorer.MakeWindow(x, y, window);
      const float fast = scorer.Score(window, x, y, plane, 0);
      if (!window.usable || fast == PatchScorer::kNoScore) continue;
      const std::optional<double> slow =
          SlowScore(views.reference_image, views.reference, views.target_image, views.target, x, y, plane, radius);
      if (!slow) continue;
      EXPECT_NEAR(fast, *slow, 2e-3) << "radius " << radius << " at " << x << ", " << y;
      ++compared;
    }
  }
  EXPECT_GT(compared, 300);
}

TEST(PatchScorer, PerfectMatchOfAViewWithItself) {
  const TwoViews views;
  Camera shifted = views.reference;
  const PatchScorer scorer({views.reference, std::make_shared<SamplingImage>(views.reference_image, 1)},
                           {{shifted, std::make_shared<SamplingImage>(views.reference_image, 3)}}, {});
  PatchScorer::Window window;
  scorer.MakeWindow(50, 50, window);
  EXPECT_NEAR(scorer.Score(window, 50, 50, {0.3F, 0.001F, -0.002F}, 0), 1.0F, 1e-4);
}

// A target whose photograph is moved by whole pixels: shifted by as much the window finds itself.
TEST(PatchScorer, AShiftMovesTheWindowInTheTarget) {
  const TwoViews views;
  GreyImage moved = views.reference_image;
  for (int y = 0; y < moved.height; ++y) {
    for (int x = 0; x < moved.width; ++x) {
      moved.grey[static_cast<size_t>(y * moved.width + x)] =
          views.reference_image.At(std::max(0, x - 2), std::min(moved.height - 1, y + 3));
    }
  }
  const PatchScorer scorer({views.reference, std::make_shared<SamplingImage>(views.reference_image, 1)},
                           {{views.reference, std::make_shared<SamplingImage>(moved, 1)}}, {});
  PatchScorer::Window window;
  scorer.MakeWindow(50, 50, window);
  const PatchPlane plane{0.3F, 0.001F, -0.002F};
  EXPECT_NEAR(scorer.Score(window, 50, 50, plane, 0, {2, -3}), 1.0F, 1e-3);
  EXPECT_LT(scorer.Score(window, 50, 50, plane, 0), 0.8F);
}

TEST(PatchScorer, AcrossTheEpipolarLineIsWhereDepthDoesNotLead) {
  const TwoViews views;
  const PatchScorer scorer = views.Scorer(3);
  const auto image = [&](int x, int y, double w) {
    return views.target.ProjectFromCam(views.target.CamFromWorld(views.reference.BackProject(x + 0.5, y + 0.5, 1 / w)));
  };
  for (const auto& [x, y] : {std::pair{20, 30}, {60, 50}, {100, 80}}) {
    const Eigen::Vector2d along = image(x, y, 0.41) - image(x, y, 0.39);
    const Eigen::Vector2f across = scorer.AcrossEpipolarLine(x, y, 0.4F, 0);
    EXPECT_NEAR(across.norm(), 1, 1e-4);
    EXPECT_NEAR(along.normalized().dot(across.cast<double>()), 0, 1e-3);
    EXPECT_NEAR(scorer.PixelsPerInverseDepth(x, y, 0.4F, 0), along.norm() / 0.02, 1e-2 * along.norm() / 0.02);
  }
}

TEST(PatchScorer, EveryInstructionSetGivesTheSameBits) {
  const TwoViews views;
  const PatchScorer scorer = views.Scorer(3);
  const int64_t supported = hwy::SupportedTargets();
  std::set<uint32_t> results;
  int targets = 0;
  for (int64_t remaining = supported; remaining != 0; remaining &= remaining - 1) {
    hwy::SetSupportedTargetsForTest(remaining & -remaining);
    hwy::GetChosenTarget().Update(hwy::SupportedTargets());
    uint32_t bits_of_all = 0;
    for (int i = 0; i < 200; ++i) {
      PatchScorer::Window window;
      scorer.MakeWindow(20 + i % 80, 20 + i % 60, window);
      const float score =
          scorer.Score(window, 20 + i % 80, 20 + i % 60, {0.4F, 0.0001F * static_cast<float>(i), 0.001F}, 0);
      uint32_t bits = 0;
      std::memcpy(&bits, &score, sizeof(bits));
      bits_of_all = bits_of_all * 31 + bits;
    }
    results.insert(bits_of_all);
    ++targets;
  }
  hwy::SetSupportedTargetsForTest(0);
  hwy::GetChosenTarget().Update(hwy::SupportedTargets());
  EXPECT_GE(targets, 2);
  EXPECT_EQ(results.size(), 1U);
}

TEST(PatchScorer, NoScoreWhereThereIsNothingToCompare) {
  TwoViews views;
  PatchScorer::Window window;
  {
    const PatchScorer scorer = views.Scorer(3);
    scorer.MakeWindow(1, 50, window);  // leaves the reference
    EXPECT_FALSE(window.usable);
    scorer.MakeWindow(60, 50, window);
    EXPECT_EQ(scorer.Score(window, 60, 50, {0, 0, 0}, 0), PatchScorer::kNoScore);        // at infinity
    EXPECT_EQ(scorer.Score(window, 60, 50, {0.4F, 0.5F, 0}, 0), PatchScorer::kNoScore);  // through the camera
    EXPECT_EQ(scorer.Score(window, 60, 50, {1e6F, 0, 0}, 0), PatchScorer::kNoScore);     // outside the target
    EXPECT_EQ(scorer.Score(window, 60, 50, {std::nanf(""), 0, 0}, 0), PatchScorer::kNoScore);
  }
  views.reference_image.grey.assign(views.reference_image.grey.size(), 77);
  const PatchScorer plain = views.Scorer(3);
  plain.MakeWindow(60, 50, window);
  EXPECT_FALSE(window.usable);
}

TEST(PatchScorer, MeanScoreIsTheMeanOfTheScores) {
  const TwoViews views;
  const Camera blind = MakeCamera(140, 110, {0, 0, 50}, 0);  // behind every plane
  const auto target_image = std::make_shared<SamplingImage>(views.target_image, 1);
  const PatchScorer scorer({views.reference, std::make_shared<SamplingImage>(views.reference_image, 1)},
                           {{views.target, target_image}, {views.reference, target_image}, {blind, target_image}},
                           {.window_radius = 3});
  PatchScorer::Window window;
  scorer.MakeWindow(60, 50, window);
  const PatchPlane plane{0.4F, 0, 0};
  const float first = scorer.Score(window, 60, 50, plane, 0);
  const float second = scorer.Score(window, 60, 50, plane, 1);
  ASSERT_NE(first, PatchScorer::kNoScore);
  ASSERT_NE(second, PatchScorer::kNoScore);
  EXPECT_FLOAT_EQ(scorer.MeanScore(window, 60, 50, plane, 0b11), (first + second) / 2);
  EXPECT_EQ(scorer.MeanScore(window, 60, 50, plane, 0b10), second);
  EXPECT_EQ(scorer.MeanScore(window, 60, 50, plane, 0b111), PatchScorer::kNoScore);
  EXPECT_EQ(scorer.MeanScore(window, 60, 50, plane, 0), PatchScorer::kNoScore);
}

TEST(PatchPlane, NormalRoundTrip) {
  const Camera camera = MakeCamera(120, 100, {0, 0, 0}, 0);
  std::mt19937 generator(5);
  std::uniform_real_distribution<double> uniform(-1, 1);
  for (int i = 0; i < 100; ++i) {
    const Eigen::Vector3d normal = Eigen::Vector3d(0.5 * uniform(generator), 0.5 * uniform(generator), -1).normalized();
    const double x = 60 + 40 * uniform(generator);
    const double y = 50 + 30 * uniform(generator);
    const double depth = 2 + uniform(generator);
    const PatchPlane plane = PlaneFromNormal(camera, x, y, depth, normal);
    EXPECT_LT((NormalInCam(camera, x, y, plane) - normal).norm(), 1e-4);
    // A neighbouring point of the plane lies on the extrapolated inverse depth.
    const Eigen::Vector3d ray = camera.RayInCam(x + 3, y - 2);
    const double z = depth * normal.dot(camera.RayInCam(x, y)) / normal.dot(ray);
    EXPECT_NEAR(plane.MovedBy(3, -2).w, 1 / z, 1e-5);
  }
}

TEST(SamplingImage, QuadsHoldTheirFourPixels) {
  const GreyImage grey = Noise(37, 23, 9);
  const SamplingImage image(grey, 2);
  for (int y = 0; y + 1 < grey.height; ++y) {
    for (int x = 0; x + 1 < grey.width; ++x) {
      const uint32_t quad = image.level(0).quads[static_cast<size_t>(y * 37 + x)];
      EXPECT_EQ(quad & 0xFF, grey.At(x, y));
      EXPECT_EQ((quad >> 8) & 0xFF, grey.At(x + 1, y));
      EXPECT_EQ((quad >> 16) & 0xFF, grey.At(x, y + 1));
      EXPECT_EQ(quad >> 24, grey.At(x + 1, y + 1));
    }
  }
}

// A photograph of noise whose columns from `begin` to `end` are not to be used.
std::shared_ptr<const SamplingImage> MaskedNoise(uint32_t seed, int begin, int end) {
  constexpr int kSide = 80;
  ColorImage mask{.width = kSide, .height = kSide, .rgb = {}};
  for (int i = 0; i < kSide * kSide; ++i) {
    const bool is_ignored = i % kSide >= begin && i % kSide < end;
    mask.rgb.insert(mask.rgb.end(), 3, is_ignored ? 0 : 255);
  }
  return std::make_shared<const SamplingImage>(Noise(kSide, kSide, seed), 1, IgnoredPixels(mask));
}

TEST(PatchScorer, IgnoredPixelsAreAsThoseBeyondTheBorder) {
  const Camera camera = MakeCamera(80, 80, {0, 0, 0}, 0);
  const PatchPlane facing = {0.2F, 0, 0};
  const int radius = PatchScorer::Options().window_radius;
  // Reference and target are one photograph, so that a window is compared with itself.
  const PatchScorer of_target({camera, MaskedNoise(5, 0, 0)}, {{camera, MaskedNoise(5, 40, 50)}}, {});
  const PatchScorer of_reference({camera, MaskedNoise(5, 40, 50)}, {{camera, MaskedNoise(5, 0, 0)}}, {});
  PatchScorer::Window window;
  for (int x = 10; x < 70; ++x) {
    of_target.MakeWindow(x, 40, window);
    ASSERT_TRUE(window.usable);
    const float score = of_target.Score(window, x, 40, facing, 0);
    if (x + radius >= 40 && x - radius < 50) EXPECT_EQ(score, PatchScorer::kNoScore) << x;
    if (x + radius + 2 < 40 || x - radius - 2 >= 50) EXPECT_GT(score, 0.99F) << x;

    of_reference.MakeWindow(x, 40, window);
    EXPECT_EQ(window.usable, x < 40 || x >= 50) << x;
    if (window.usable) EXPECT_GT(of_reference.Score(window, x, 40, facing, 0), 0.99F) << x;
    for (int k = 0; window.usable && k < 2 * radius + 1; ++k) {
      if (x - radius + k >= 40 && x - radius + k < 50) EXPECT_EQ(window.weights[k], 0) << x;
    }
  }
}

TEST(PatchScorer, OutsideOfTheRegionNothingHasAScore) {
  const Camera camera = MakeCamera(80, 80, {0, 0, 0}, 0.2);
  const auto noise = MaskedNoise(5, 0, 0);
  const Eigen::Vector3d center = camera.BackProject(40.5, 40.5, 5);
  const OrientedBox box = {.center = center, .axes = Eigen::Matrix3d::Identity(), .size = {0.4, 0.4, 0.4}};
  const PatchScorer scorer({camera, noise}, {{camera, noise}}, {}, box);
  PatchScorer::Window window;
  for (int x = 10; x < 70; ++x) {
    scorer.MakeWindow(x, 40, window);
    for (const double z : {2.0, 4.7, 4.9, 5.0, 5.1, 5.3, 9.0}) {
      const bool inside = box.Contains(camera.BackProject(x + 0.5, 40.5, z));
      const float score = scorer.Score(window, x, 40, {static_cast<float>(1 / z), 0, 0}, 0);
      EXPECT_EQ(score > PatchScorer::kNoScore, inside) << x << " " << z;
    }
  }
}

}  // namespace
}  // namespace meshwright
