// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include <Eigen/Geometry>

#include "tools/synthetic/hash_noise.h"
#include "tools/synthetic/stage.h"

namespace meshwright {
namespace {

constexpr double kPi = std::numbers::pi;

// A tube around the (2, 3) torus knot.
void AddTorusKnot(WorldBuilder& builder, const Eigen::Vector3d& center, double size, double tube) {
  const auto curve = [&](double u) {
    const double a = 2 * kPi * u;
    const double r = 2 + std::cos(3 * a);
    return Eigen::Vector3d(center + size * Eigen::Vector3d(r * std::cos(2 * a), r * std::sin(2 * a), -std::sin(3 * a)));
  };
  const auto position = [&](double u, double v) {
    const Eigen::Vector3d along = (curve(u + 1e-4) - curve(u - 1e-4)).normalized();
    const Eigen::Vector3d side = along.cross(Eigen::Vector3d::UnitZ()).normalized();
    const Eigen::Vector3d up = side.cross(along);
    const double a = 2 * kPi * v;
    return Eigen::Vector3d(curve(u) + tube * (std::cos(a) * side + std::sin(a) * up));
  };
  builder.AddGrid(360, 32, Material::kMarble, position);
}

// A disc of radius r at height z, facing up (or down).
void AddDisc(WorldBuilder& builder, double r, double z, bool up, Material material) {
  builder.AddGrid(
      64, 8, material,
      [=](double u, double v) {
        const double angle = (up ? 2 : -2) * kPi * u;
        return Eigen::Vector3d(r * (1 - v) * std::cos(angle), r * (1 - v) * std::sin(angle), z);
      },
      [=](double u, double v) {
        return Eigen::Vector2d(r * (1 - v) * std::cos(2 * kPi * u), r * (1 - v) * std::sin(2 * kPi * u));
      });
}

void AddDrum(WorldBuilder& builder, double r, double low, double high, Material side, Material lid, double ornament) {
  const SurfaceFrame upright;
  builder.AddColumn(upright, {0, low, 0}, high - low, 256, 12, side, [&](double v, double angle) {
    const double fade = std::sin(kPi * v);
    return r + ornament * fade * (0.6 * std::sin(14 * angle) * std::cos(9 * v) + 0.4 * std::sin(31 * angle + 5 * v));
  });
  AddDisc(builder, r, high, true, lid);
  AddDisc(builder, r, low, false, lid);
}

void AddDome(WorldBuilder& builder, double low, double radius, uint32_t salt) {
  builder.AddGrid(180, 90, Material::kRoughStone, [=](double u, double v) {
    const double longitude = 2 * kPi * u;
    const double latitude = 0.5 * kPi * v;
    const Eigen::Vector3d direction(std::cos(latitude) * std::cos(longitude), std::cos(latitude) * std::sin(longitude),
                                    std::sin(latitude));
    const float bumps = FractalNoise((2.5 * direction).cast<float>(), 1.0F, 0.5F, 0.1F, salt);
    // Six niches around the dome.
    const double niche = std::max(0.0, std::cos(6 * longitude)) * std::max(0.0, std::sin(3 * latitude));
    return Eigen::Vector3d(Eigen::Vector3d(0, 0, low) + radius * (1 + 0.10 * bumps - 0.16 * niche * niche) * direction);
  });
}

}  // namespace

Stage BuildRing(const SyntheticOptions& options) {
  HashRandom random(HashBits(options.seed, 102));
  const auto salt = static_cast<uint32_t>(random.Bits());
  WorldBuilder builder;
  AddDrum(builder, 1.10, 0.00, 0.14, Material::kAshlar, Material::kRoughStone, 0.0);
  AddDrum(builder, 0.96, 0.13, 0.26, Material::kRoughStone, Material::kPaving, 0.02);
  const SurfaceFrame upright;
  constexpr int kColumns = 8;
  for (int i = 0; i < kColumns; ++i) {
    const double angle = 2 * kPi * (i + 0.3) / kColumns;
    builder.AddColumn(upright, {0.78 * std::sin(angle), 0.25, 0.78 * std::cos(angle)}, 0.92, 72, 40, Material::kMarble,
                      [](double v, double a) {
                        const bool ring = v < 0.06 || v > 0.94;
                        return ring ? 0.105 : 0.088 - 0.012 * v - 0.006 * std::abs(std::sin(6 * a));
                      });
  }
  AddTorusKnot(builder, {0, 0, 0.62}, 0.15, 0.07);
  AddDrum(builder, 0.98, 1.16, 1.34, Material::kMarble, Material::kPlaster, 0.025);
  AddDome(builder, 1.33, 0.62, salt);

  Stage stage;
  stage.world = std::move(builder.world());
  stage.world.unit = 0.3F;  // a model: bricks and blocks are small
  stage.world.to_sun = Eigen::Vector3f(0.45F, -0.55F, 1.0F).normalized();
  stage.world.sun = 0.85F;
  stage.world.ambient = 0.50F;

  for (int i = 0; i < options.cameras; ++i) {
    const double angle = 2 * kPi * (i + random.Uniform(-0.05, 0.05)) / options.cameras;
    const double elevation = (i % 2 == 0 ? 14.0 : 30.0) * kPi / 180;
    const double distance = 4.6 + random.Uniform(-0.1, 0.1);
    const Eigen::Vector3d center(distance * std::cos(elevation) * std::sin(angle),
                                 -distance * std::cos(elevation) * std::cos(angle),
                                 0.95 + distance * std::sin(elevation));
    const Eigen::Vector3d target(random.Uniform(-0.03, 0.03), random.Uniform(-0.03, 0.03), 0.95);
    stage.cameras.push_back(LookAt(options, 1.5 * std::min(options.width, options.height), center, target));
  }
  return stage;
}

}  // namespace meshwright
