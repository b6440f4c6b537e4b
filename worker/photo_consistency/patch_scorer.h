// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include <Eigen/Core>
#include <absl/status/status.h>

#include "common/geometry/camera.h"
#include "common/geometry/oriented_box.h"
#include "common/image/sampling_image.h"
#include "worker/photo_consistency/backdrop.h"

namespace meshwright {

// A patch's plane as the reference camera's pixels see it: inverse depth is an affine function of the pixel for any
// plane, 1/z(x, y) = w + gx * (x - x0) + gy * (y - y0), so extrapolating it to a neighbouring ray is exact.
struct PatchPlane {
  float w = 0;   // inverse depth at the patch's own pixel (x0, y0), 1 / scene units
  float gx = 0;  // its slope per pixel in x
  float gy = 0;  // and in y

  PatchPlane MovedBy(float dx_px, float dy_px) const { return {w + gx * dx_px + gy * dy_px, gx, gy}; }
};

// Plane through x_in_cam with this normal (reference camera's frame), at the pixel (x0, y0) where x_in_cam projects.
PatchPlane PlaneFromNormal(const Camera& reference, double x0, double y0, double depth,
                           const Eigen::Vector3d& normal_in_cam);
// Unit normal towards the camera, in the reference camera's frame.
Eigen::Vector3d NormalInCam(const Camera& reference, double x0, double y0, const PatchPlane& plane);

struct ScoredView {
  Camera camera;
  std::shared_ptr<const SamplingImage> grey;
};

// Photo-consistency of patches of one reference view (section 3.6, Jancosek et al. 2009): normalised cross-correlation
// (NCC) between a window of the reference and its image through the patch's plane in a target. Unlike the paper's, the
// window has weights: pixels that differ from its centre likely belong to another surface and count less, so that a
// window beside a depth step follows its own side (Yoon and Kweon 2006, adaptive support weights). Thread-safe.
class PatchScorer {
 public:
  // What Score() returns when there is nothing to compare: the window leaves an image or has ignored pixels of the
  // target, the patch is outside of the region, the plane goes through a camera
  // or is seen from behind, or the reference window has no texture.
  static constexpr float kNoScore = -2.0F;

  struct Options {
    int window_radius = 3;           // s, px: (2 s + 1)^2 pixels, 1..7 (section 3.6: 2 or 3)
    double similarity_scale = 15;    // grey levels at which a pixel's weight falls to 1/e of the centre's, > 0
    double min_texture_sigma = 0.5;  // standard deviation of the reference window, grey levels, >= 0

    absl::Status Validate() const;
  };

  // `region`, in the world: patches outside of it have no score, and no window is usable whose ray passes by.
  PatchScorer(ScoredView reference, std::vector<ScoredView> targets, const Options& options,
              const std::optional<OrientedBox>& region = std::nullopt);
  ~PatchScorer();

  const Camera& reference() const { return reference_.camera; }
  const SamplingImage& reference_image() const { return *reference_.grey; }
  int targets() const { return static_cast<int>(targets_.size()); }
  const ScoredView& target(int i) const { return targets_[static_cast<size_t>(i)]; }
  const Options& options() const { return options_; }

  // The reference window around integer pixel (x, y), made once and compared many times.
  struct Window {
    // MakeWindow fills the arrays; clearing them before would cost as much again.
    Window() {}  // NOLINT(cppcoreguidelines-pro-type-member-init,modernize-use-equals-default)

    float weights[232];  // sum to 1; padded with zeros to whole groups
    float values[232];   // weight * (grey - mean) / weighted standard deviation; padded likewise
    float sigma = 0;     // grey levels
    float min_w = 0;     // inverse depths that the region has on the centre's ray, 1 / scene units
    float max_w = 0;
    bool may_hold_surface = false;   // inside the image and the region, its centre not ignored, not of a black backdrop
    bool may_show_backdrop = false;  // as dark as the black backdrop that this photograph has
    bool usable = false;             // may hold surface and is textured
  };
  void MakeWindow(int x, int y, Window& window) const;

  // NCC in [-1, 1] between the window around the centre of pixel (x, y) and target i through the plane, or kNoScore.
  // `shift_px` moves the window's image in the target.
  float Score(const Window& window, int x, int y, const PatchPlane& plane, int target,
              const Eigen::Vector2f& shift_px = Eigen::Vector2f::Zero()) const;

  // q(p) of section 3.6: mean of the scores in the targets of `sigma` (bit i: target i), at least one. kNoScore when
  // any of them has none.
  float MeanScore(const Window& window, int x, int y, const PatchPlane& plane, uint32_t sigma) const;

  // How far the image of the pixel's ray point in target i moves per unit of inverse depth, px times scene units.
  float PixelsPerInverseDepth(int x, int y, float inverse_depth, int target) const;

  // Unit vector in target i across the epipolar line of the pixel's ray, at the image of the ray's point; zero where
  // that does not move with depth.
  Eigen::Vector2f AcrossEpipolarLine(int x, int y, float inverse_depth, int target) const;

 private:
  struct Target;
  // By how much that image moves per unit of inverse depth, px times scene units.
  Eigen::Vector2f MovementPerInverseDepth(int x, int y, float inverse_depth, int target) const;
  // Sets the window's inverse depths; false when the ray of pixel (x, y) passes by the region.
  bool SetRange(int x, int y, Window& window) const;

  ScoredView reference_;
  std::vector<ScoredView> targets_;
  std::optional<OrientedBox> region_in_reference_;
  Options options_;
  Backdrop backdrop_;  // of the reference
  std::vector<Target> geometry_;
  int samples_ = 0;         // (2 s + 1)^2
  int padded_samples_ = 0;  // rounded up to whole groups of the kernel
  std::vector<float> dx_;   // px from the window's centre, per sample
  std::vector<float> dy_;
  std::array<float, 256> similarity_ = {};  // weight by absolute difference from the centre, grey levels
};

}  // namespace meshwright
