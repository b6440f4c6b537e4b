// SPDX-License-Identifier: Apache-2.0
#include "worker/photo_consistency/patch_scorer.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <utility>

#include <Eigen/LU>

#include "common/base/check.h"
#include "common/base/out_of_range.h"
#include "worker/photo_consistency/ncc_kernel.h"

namespace meshwright {
namespace {

// A target in which the window shrinks to less than this share of its area, or that sees the plane from behind, says
// nothing about it.
constexpr float kMinAreaRatio = 0.02F;
// From a linear magnification of sqrt(2) on, a coarser level of the target matches the reference's sampling better.
constexpr float kAreaRatioForNextLevel = 2.0F;
// Keeps rounding in the kernel from leaving the image, px.
constexpr float kBorderMargin = 0.05F;
// Below it the weights leave only pixels of the centre's value, squared grey levels.
constexpr float kMinWeightedVariance = 0.05F;

}  // namespace

PatchPlane PlaneFromNormal(const Camera& reference, double x0, double y0, double depth,
                           const Eigen::Vector3d& normal_in_cam) {
  // n . (z r(x, y)) = n . (depth r0)  =>  1/z = n . r(x, y) / (depth n . r0).
  const double denominator = depth * normal_in_cam.dot(reference.RayInCam(x0, y0));
  return {static_cast<float>(1.0 / depth), static_cast<float>(normal_in_cam.x() / (reference.fx * denominator)),
          static_cast<float>(normal_in_cam.y() / (reference.fy * denominator))};
}

Eigen::Vector3d NormalInCam(const Camera& reference, double x0, double y0, const PatchPlane& plane) {
  // n / d = K^T m with m . (x, y, 1) = 1/z; m grows with n . r > 0, away from the camera: turn it round.
  const Eigen::Vector3d m(plane.gx, plane.gy, plane.w - plane.gx * x0 - plane.gy * y0);
  return -(reference.K().transpose() * m).normalized();
}

absl::Status PatchScorer::Options::Validate() const {
  if (window_radius < 1 || window_radius > 7) return OutOfRange("scoring.window_radius", window_radius, "1..7 px");
  if (!(similarity_scale > 0)) return OutOfRange("scoring.similarity_scale", similarity_scale, "> 0");
  if (!(min_texture_sigma >= 0)) return OutOfRange("scoring.min_texture_sigma", min_texture_sigma, ">= 0");
  return absl::OkStatus();
}

// K_t R K_r^-1 and K_t t, so that the homography of a plane m is a + b m^T.
struct PatchScorer::Target {
  Eigen::Matrix3f a;
  Eigen::Vector3f b;
};

PatchScorer::PatchScorer(ScoredView reference, std::vector<ScoredView> targets, const Options& options,
                         const std::optional<OrientedBox>& region)
    : reference_(std::move(reference)), targets_(std::move(targets)), options_(options), backdrop_(*reference_.grey) {
  MW_CHECK(options_.window_radius >= 1 && options_.window_radius <= 7);
  const int side = 2 * options_.window_radius + 1;
  samples_ = side * side;
  padded_samples_ = (samples_ + kNccGroup - 1) / kNccGroup * kNccGroup;
  dx_.assign(static_cast<size_t>(padded_samples_), 0.0F);
  dy_.assign(static_cast<size_t>(padded_samples_), 0.0F);
  for (int k = 0; k < samples_; ++k) {
    dx_[static_cast<size_t>(k)] = static_cast<float>(k % side - options_.window_radius);
    dy_[static_cast<size_t>(k)] = static_cast<float>(k / side - options_.window_radius);
  }
  for (size_t d = 0; d < similarity_.size(); ++d) {
    similarity_[d] = static_cast<float>(std::exp(-static_cast<double>(d) / options_.similarity_scale));
  }
  if (region.has_value()) region_in_reference_ = Transformed(reference_.camera.cam_from_world, *region);
  for (const ScoredView& view : targets_) {
    const Rigid3 target_from_reference = view.camera.cam_from_world * Inverse(reference_.camera.cam_from_world);
    // Sampling coordinates have the centre of the top-left pixel at (0, 0).
    Eigen::Matrix3d k_target = view.camera.K();
    k_target(0, 2) -= 0.5;
    k_target(1, 2) -= 0.5;
    geometry_.push_back({(k_target * target_from_reference.rotation * reference_.camera.K().inverse()).cast<float>(),
                         (k_target * target_from_reference.translation).cast<float>()});
  }
}

PatchScorer::~PatchScorer() = default;

bool PatchScorer::SetRange(int x, int y, Window& window) const {
  window.min_w = 0;
  window.max_w = std::numeric_limits<float>::infinity();
  if (!region_in_reference_.has_value()) return true;
  const auto depths = DepthsInside(*region_in_reference_, reference_.camera.RayInCam(x + 0.5, y + 0.5));
  if (!depths.has_value()) return false;
  window.min_w = static_cast<float>(1 / depths->max);
  window.max_w = static_cast<float>(1 / depths->min);
  return true;
}

void PatchScorer::MakeWindow(int x, int y, Window& window) const {
  const int radius = options_.window_radius;
  const SamplingImage& image = *reference_.grey;
  window.may_hold_surface = false;
  window.may_show_backdrop = false;
  window.usable = false;
  window.sigma = 0;
  if (x < radius || y < radius || x + radius >= image.width() || y + radius >= image.height()) return;
  if (backdrop_.Covers(x, y)) return;
  const IgnoredPixels& ignored = image.ignored();
  if (ignored.At(x, y) || !SetRange(x, y, window)) return;
  window.may_hold_surface = true;
  const bool has_ignored = ignored.AnyIn(x - radius, y - radius, x + radius, y + radius);
  const SamplingImage::Level& level = image.level(0);
  int sum = 0;
  int sum_of_squares = 0;
  int k = 0;
  for (int row = y - radius; row <= y + radius; ++row) {
    const uint32_t* quads =
        &level.quads[static_cast<size_t>(row) * static_cast<size_t>(level.width) + static_cast<size_t>(x - radius)];
    for (int column = 0; column <= 2 * radius; ++column) {
      const int value = static_cast<int>(quads[column] & 0xFFU);
      sum += value;
      sum_of_squares += value * value;
      window.values[k++] = static_cast<float>(value);
    }
  }
  window.may_show_backdrop = backdrop_.MayBe(static_cast<int>(window.values[samples_ / 2]));
  const auto n = static_cast<float>(samples_);
  // Integers up to here: exact.
  const float variance =
      static_cast<float>(static_cast<int64_t>(samples_) * sum_of_squares - static_cast<int64_t>(sum) * sum) / (n * n);
  window.sigma = std::sqrt(variance);
  if (window.sigma < options_.min_texture_sigma || window.sigma <= 0) return;
  const int center = static_cast<int>(window.values[samples_ / 2]);
  float total = 0;
  for (int i = 0; i < samples_; ++i) {
    const int difference = std::abs(static_cast<int>(window.values[i]) - center);
    float weight = similarity_[static_cast<size_t>(difference)];
    if (has_ignored && ignored.At(x + static_cast<int>(dx_[static_cast<size_t>(i)]),
                                  y + static_cast<int>(dy_[static_cast<size_t>(i)]))) {
      weight = 0;
    }
    window.weights[i] = weight;
    total += weight;
  }
  const float inverse_total = 1.0F / total;
  float mean = 0;
  float mean_square = 0;
  for (int i = 0; i < samples_; ++i) {
    window.weights[i] *= inverse_total;
    mean += window.weights[i] * window.values[i];
    mean_square += window.weights[i] * window.values[i] * window.values[i];
  }
  const float weighted_variance = mean_square - mean * mean;
  if (weighted_variance < kMinWeightedVariance) return;
  const float scale = 1.0F / std::sqrt(weighted_variance);
  for (int i = 0; i < samples_; ++i) window.values[i] = (window.values[i] - mean) * scale * window.weights[i];
  for (int i = samples_; i < padded_samples_; ++i) {
    window.values[i] = 0.0F;
    window.weights[i] = 0.0F;
  }
  window.usable = true;
}

float PatchScorer::Score(const Window& window, int x, int y, const PatchPlane& plane, int target,
                         const Eigen::Vector2f& shift_px) const {
  if (!window.usable || !(plane.w > 0) || plane.w < window.min_w || plane.w > window.max_w) return kNoScore;
  const Target& geometry = geometry_[static_cast<size_t>(target)];
  const float x0 = static_cast<float>(x) + 0.5F;
  const float y0 = static_cast<float>(y) + 0.5F;
  NccInput input;
  for (int i = 0; i < 3; ++i) {
    input.c[i] = geometry.a(i, 0) * x0 + geometry.a(i, 1) * y0 + geometry.a(i, 2) + geometry.b(i) * plane.w;
    input.col0[i] = geometry.a(i, 0) + geometry.b(i) * plane.gx;
    input.col1[i] = geometry.a(i, 1) + geometry.b(i) * plane.gy;
  }
  for (int i = 0; i < 2; ++i) {
    input.c[i] += shift_px[i] * input.c[2];
    input.col0[i] += shift_px[i] * input.col0[2];
    input.col1[i] += shift_px[i] * input.col1[2];
  }
  const auto radius = static_cast<float>(options_.window_radius);
  // The plane must lie in front of both cameras over the whole window: third coordinate and inverse depth are affine,
  // so their smallest values lie in corners.
  const float min_third = input.c[2] - radius * (std::fabs(input.col0[2]) + std::fabs(input.col1[2]));
  const float min_inverse_depth = plane.w - radius * (std::fabs(plane.gx) + std::fabs(plane.gy));
  if (!(min_third > 0) || !(min_inverse_depth > 0)) return kNoScore;

  const float px = input.c[0] / input.c[2];
  const float py = input.c[1] / input.c[2];
  // Area ratio of the window's image: the Jacobian of the homography at the centre.
  const float jacobian = ((input.col0[0] - px * input.col0[2]) * (input.col1[1] - py * input.col1[2]) -
                          (input.col1[0] - px * input.col1[2]) * (input.col0[1] - py * input.col0[2])) /
                         (input.c[2] * input.c[2]);
  if (!(jacobian > kMinAreaRatio)) return kNoScore;

  const SamplingImage& image = *targets_[static_cast<size_t>(target)].grey;
  int level_index = 0;
  float ratio = jacobian;
  while (ratio > kAreaRatioForNextLevel && level_index + 1 < image.level_count()) {
    ratio *= 0.25F;
    ++level_index;
  }
  const SamplingImage::Level& level = image.level(level_index);
  if (level_index > 0) {
    // (x + 0.5) / 2^l - 0.5 in coordinates that count from pixel centres.
    const float scale = 1.0F / static_cast<float>(1 << level_index);
    const float shift = 0.5F * scale - 0.5F;
    for (int i = 0; i < 2; ++i) {
      input.c[i] = input.c[i] * scale + input.c[2] * shift;
      input.col0[i] = input.col0[i] * scale + input.col0[2] * shift;
      input.col1[i] = input.col1[i] * scale + input.col1[2] * shift;
    }
  }
  // A homography maps the window to a convex quadrilateral: it lies in the image when its corners do.
  const float max_x = static_cast<float>(level.width - 1) - kBorderMargin;
  const float max_y = static_cast<float>(level.height - 1) - kBorderMargin;
  float left = max_x;
  float right = 0;
  float top = max_y;
  float bottom = 0;
  for (const float corner_x : {-radius, radius}) {
    for (const float corner_y : {-radius, radius}) {
      const float third = input.c[2] + input.col0[2] * corner_x + input.col1[2] * corner_y;
      const float tx = (input.c[0] + input.col0[0] * corner_x + input.col1[0] * corner_y) / third;
      const float ty = (input.c[1] + input.col0[1] * corner_x + input.col1[1] * corner_y) / third;
      if (!(tx >= kBorderMargin && ty >= kBorderMargin && tx <= max_x && ty <= max_y)) return kNoScore;
      left = std::min(left, tx);
      right = std::max(right, tx);
      top = std::min(top, ty);
      bottom = std::max(bottom, ty);
    }
  }
  if (image.ignored()) {
    // The pixels of level 0 below the rectangle around the window's image, with those that samples reach.
    const auto first = [&](float c) { return static_cast<int>(c) << level_index; };
    const auto last = [&](float c) { return ((static_cast<int>(c) + 2) << level_index) - 1; };
    if (image.ignored().AnyIn(first(left), first(top), last(right), last(bottom))) return kNoScore;
  }
  input.count = padded_samples_;
  input.dx = dx_.data();
  input.dy = dy_.data();
  input.weights = window.weights;
  input.values = window.values;
  input.quads = level.quads.data();
  input.stride = level.width;
  return Ncc(input);
}

float PatchScorer::MeanScore(const Window& window, int x, int y, const PatchPlane& plane, uint32_t sigma) const {
  float sum = 0;
  for (uint32_t rest = sigma; rest != 0; rest &= rest - 1) {
    const float ncc = Score(window, x, y, plane, std::countr_zero(rest));
    if (ncc == kNoScore) return kNoScore;
    sum += ncc;
  }
  return sigma != 0 ? sum / static_cast<float>(std::popcount(sigma)) : kNoScore;
}

Eigen::Vector2f PatchScorer::MovementPerInverseDepth(int x, int y, float inverse_depth, int target) const {
  const Target& geometry = geometry_[static_cast<size_t>(target)];
  const Eigen::Vector3f image =
      geometry.a * Eigen::Vector3f(static_cast<float>(x) + 0.5F, static_cast<float>(y) + 0.5F, 1.0F) +
      geometry.b * inverse_depth;
  // Derivative of image.xy / image.z by inverse depth, where image moves by b.
  return {(geometry.b.x() - geometry.b.z() * image.x() / image.z()) / image.z(),
          (geometry.b.y() - geometry.b.z() * image.y() / image.z()) / image.z()};
}

float PatchScorer::PixelsPerInverseDepth(int x, int y, float inverse_depth, int target) const {
  const Eigen::Vector2f moved = MovementPerInverseDepth(x, y, inverse_depth, target);
  return std::sqrt(moved.x() * moved.x() + moved.y() * moved.y());
}

Eigen::Vector2f PatchScorer::AcrossEpipolarLine(int x, int y, float inverse_depth, int target) const {
  const Eigen::Vector2f moved = MovementPerInverseDepth(x, y, inverse_depth, target);
  const float length = moved.norm();
  return length > 0 ? Eigen::Vector2f(-moved.y() / length, moved.x() / length) : Eigen::Vector2f(0, 0);
}

}  // namespace meshwright
