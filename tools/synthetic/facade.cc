// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/Geometry>

#include "tools/synthetic/hash_noise.h"
#include "tools/synthetic/house.h"
#include "tools/synthetic/stage.h"

namespace meshwright {
namespace {

constexpr double kWidth = 12.5;  // m, of the house

void AddDomes(WorldBuilder& builder, const SurfaceFrame& frame) {
  // Round shields with dents beside the door.
  for (const double s : {0.2 * kWidth, 0.8 * kWidth}) {
    const double t = 2.5;
    builder.AddGrid(
        48, 24, Material::kMarble,
        [&](double u, double v) {
          const double angle = -2 * std::numbers::pi * u;
          const double r = 0.42 * (1 - v);
          const double dents = 0.035 * std::sin(5 * angle) * std::sin(std::numbers::pi * v);
          const double out = 0.24 * std::sqrt(std::max(0.0, 1 - (1 - v) * (1 - v))) + dents;
          return frame.At(s + r * std::sin(angle), t + r * std::cos(angle), out);
        },
        [&](double u, double v) {
          const double angle = -2 * std::numbers::pi * u;
          return Eigen::Vector2d(0.42 * (1 - v) * std::sin(angle), 0.42 * (1 - v) * std::cos(angle));
        });
  }
}

}  // namespace

Stage BuildFacade(const SyntheticOptions& options) {
  HashRandom random(HashBits(options.seed, 101));
  const auto salt = static_cast<uint32_t>(random.Bits());
  WorldBuilder builder;
  const SurfaceFrame front{.origin = {-0.5 * kWidth, 0, 0}};
  AddHouse(builder, front, {.width = kWidth, .balcony = true}, salt);
  AddDomes(builder, front);
  builder.AddGrid(160, 140, Material::kGround, [&](double u, double v) {
    const Eigen::Vector3d x(-12 + 24 * u, -13 + 14 * v, 0);
    const float bumps = FractalNoise((x / 0.6).cast<float>(), 2.0F, 0.6F, 0.15F, salt + 5);
    return Eigen::Vector3d(x.x(), x.y(), 0.03 * bumps);
  });
  // Two tubs before the wall hide parts of it.
  for (const double s : {0.19 * kWidth, 0.86 * kWidth}) {
    builder.AddColumn(front, {s, 0.0, 1.3}, 0.75, 48, 12, Material::kStuccoStain,
                      [](double v, double) { return 0.30 + 0.10 * v + (v > 0.85 ? 0.05 : 0.0); });
    builder.AddColumn(front, {s, 0.6, 1.3}, 0.95, 64, 48, Material::kGround, [&](double v, double angle) {
      const Eigen::Vector3d x(std::sin(angle), 2 * v, std::cos(angle) + s);
      const double leaves = 1 + 0.3 * FractalNoise((4 * x).cast<float>(), 1.0F, 0.6F, 0.1F, salt + 9);
      return 0.42 * leaves * std::sqrt(std::max(0.0, 1 - (2 * v - 1) * (2 * v - 1)));
    });
  }

  Stage stage;
  stage.world = std::move(builder.world());
  stage.world.to_sun = Eigen::Vector3f(-0.55F, -0.75F, 0.72F).normalized();
  stage.world.sun = 0.95F;
  stage.world.ambient = 0.42F;
  stage.world.sky_low = {0.62F, 0.70F, 0.80F};
  stage.world.sky_high = {0.22F, 0.38F, 0.66F};

  // An arc of at most 104 degrees with steps of at most 10; every other camera is held high.
  const double step = std::min(10.0, 104.0 / (options.cameras - 1)) * std::numbers::pi / 180;
  for (int i = 0; i < options.cameras; ++i) {
    const double angle = (i - 0.5 * (options.cameras - 1)) * step + random.Uniform(-0.01, 0.01);
    const double distance = 9.6 + random.Uniform(-0.4, 0.4);
    const double height = i % 2 == 0 ? 1.7 : 4.2;
    const Eigen::Vector3d center(distance * std::sin(angle), -distance * std::cos(angle),
                                 height + random.Uniform(-0.1, 0.1));
    const Eigen::Vector3d target(random.Uniform(-0.3, 0.3), 0, 3.6 + random.Uniform(-0.2, 0.2));
    stage.cameras.push_back(LookAt(options, 0.92 * std::max(options.width, options.height), center, target));
  }
  return stage;
}

}  // namespace meshwright
