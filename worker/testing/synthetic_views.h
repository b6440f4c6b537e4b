// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <vector>

#include "tools/raycast/depth_map.h"
#include "tools/synthetic/synthetic_scene.h"

#include "common/base/thread_pool.h"
#include "worker/photo_consistency/patch_scorer.h"
#include "worker/seeding/seeding.h"
#include "worker/visibility/accepted_depth.h"

namespace meshwright::testing_world {

// The one synthetic world as the worker's tests see it: a reference view of a small facade, four targets around it, and
// what is exactly known about every ray.
struct SyntheticViews {
  SyntheticScene scene;
  int reference = 2;
  std::vector<int> targets = {0, 1, 3, 4};
  Lattice lattice;
  DepthMap truth;  // over `lattice`

  // Of the first target only so much of its width is to be used.
  PatchScorer Scorer(const PatchScorer::Options& options = {}, double share_of_first = 1) const {
    return PatchScorer(ViewOf(reference),
                       {ViewOf(targets[0], share_of_first), ViewOf(targets[1]), ViewOf(targets[2]), ViewOf(targets[3])},
                       options);
  }

  const Camera& reference_camera() const { return scene.cameras[static_cast<size_t>(reference)]; }

  // The true patch on a ray; w = 0 where the ray meets nothing.
  PatchPlane TruePlane(int64_t node) const {
    const auto i = static_cast<size_t>(node);
    if (!(truth.depth[i] > 0)) return {};
    const Eigen::Vector2d pixel =
        lattice.Pixel(static_cast<int>(node % lattice.columns), static_cast<int>(node / lattice.columns));
    const Eigen::Vector3d normal_in_cam =
        reference_camera().cam_from_world.rotation * truth.normal_in_world[i].cast<double>();
    return PlaneFromNormal(reference_camera(), pixel.x(), pixel.y(), truth.depth[i], normal_in_cam);
  }

  // True patches on every `stride`-th node in both directions that all of their Sigma sees well.
  std::vector<Seed> TrueSeeds(const PatchScorer& scorer, int stride) const {
    std::vector<Seed> seeds;
    for (int row = 0; row < lattice.rows; row += stride) {
      for (int column = 0; column < lattice.columns; column += stride) {
        Seed seed{.node = static_cast<int32_t>(lattice.Index(column, row))};
        seed.plane = TruePlane(seed.node);
        PatchScorer::Window window;
        scorer.MakeWindow(lattice.PixelX(column), lattice.PixelY(row), window);
        float sum = 0;
        int count = 0;
        for (int target = 0; target < scorer.targets(); ++target) {
          const float q = scorer.Score(window, lattice.PixelX(column), lattice.PixelY(row), seed.plane, target);
          if (q < 0.8F) continue;
          seed.sigma |= uint32_t{1} << target;
          sum += q;
          ++count;
        }
        if (count < 2) continue;
        seed.quality = sum / static_cast<float>(count);
        seeds.push_back(seed);
      }
    }
    return seeds;
  }

  // Distance of an inverse depth from the truth on its ray, in steps d_r.
  double ErrorInSteps(int64_t node, float w) const {
    const double z = truth.depth[static_cast<size_t>(node)];
    return std::abs(1.0 / w - z) / (lattice.step * z / reference_camera().focal());
  }

 private:
  ScoredView ViewOf(int i, double share = 1) const {
    const auto index = static_cast<size_t>(i);
    const ColorImage& image = scene.images[index];
    ColorImage mask{image.width, image.height, std::vector<uint8_t>(image.rgb.size(), 255)};
    for (size_t k = 0; k < mask.rgb.size(); ++k) {
      const auto x = static_cast<double>(k / 3 % static_cast<size_t>(image.width));
      if (x >= share * image.width) mask.rgb[k] = 0;
    }
    IgnoredPixels ignored = share < 1 ? IgnoredPixels(mask) : IgnoredPixels();
    return {scene.cameras[index], std::make_shared<SamplingImage>(ToGrey(image), 3, std::move(ignored))};
  }
};

inline SyntheticViews MakeSyntheticViews(int step) {
  ThreadPool pool(2);
  SyntheticOptions options;
  options.cameras = 5;
  options.width = 320;
  options.height = 240;
  SyntheticViews views;
  views.scene = MakeSyntheticScene(options, pool).value();
  views.lattice = Lattice::For(views.reference_camera(), step);
  const MeshRayCaster caster(views.scene.ground_truth);
  views.truth = RenderDepth(caster, views.reference_camera(), step, pool);
  return views;
}

}  // namespace meshwright::testing_world
