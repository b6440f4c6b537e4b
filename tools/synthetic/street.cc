// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>
#include <vector>

#include <Eigen/Geometry>

#include "tools/synthetic/hash_noise.h"
#include "tools/synthetic/house.h"
#include "tools/synthetic/stage.h"

namespace meshwright {
namespace {

constexpr double kHalfWidth = 5.5;                    // m, from the middle of the street to the walls
constexpr double kStationStep = 1.05;                 // m between stations of two cameras
constexpr double kYaw = 58 * std::numbers::pi / 180;  // of the optical axes from the street's direction

HouseStyle RandomStyle(HashRandom& random) {
  constexpr Material kGroundFloors[] = {Material::kAshlar, Material::kRoughStone, Material::kMarble, Material::kBrick};
  constexpr Material kUpperFloors[] = {Material::kBrick, Material::kStuccoStain, Material::kRoughStone,
                                       Material::kAshlar};
  constexpr Material kPanels[] = {Material::kPlaster, Material::kStuccoStain, Material::kPaint};
  HouseStyle style;
  style.windows = 2 + random.Index(3);
  style.width = style.windows * random.Uniform(2.0, 2.7);
  style.storeys = 2 + random.Index(2);
  style.height = 1.4 + style.storeys * random.Uniform(2.9, 3.4);
  style.ground_floor = kGroundFloors[random.Index(4)];
  style.upper_floors = kUpperFloors[random.Index(4)];
  style.panel = kPanels[random.Index(3)];
  style.recess = random.Uniform(0.18, 0.4);
  style.frieze = random.Index(2) == 0;
  style.balcony = style.windows >= 3 && random.Index(3) == 0;
  style.spacing = 0.12;
  return style;
}

// Houses side by side from s = 0 to at least `length`.
void AddRow(WorldBuilder& builder, const SurfaceFrame& row, double length, HashRandom& random) {
  double s = 0;
  while (s < length) {
    const HouseStyle style = RandomStyle(random);
    SurfaceFrame frame = row;
    frame.origin = row.At(s, 0, random.Uniform(-0.35, 0.0));
    AddHouse(builder, frame, style, static_cast<uint32_t>(random.Bits()));
    s += style.width;
  }
}

void AddGroundStrip(WorldBuilder& builder, double x_low, double x_high, double y_low, double y_high, double z,
                    double bumps, Material material, uint32_t salt) {
  const int columns = std::max(1, static_cast<int>((x_high - x_low) / 0.2));
  const int rows = std::max(1, static_cast<int>((y_high - y_low) / 0.2));
  builder.AddGrid(
      columns, rows, material,
      [&](double u, double v) {
        const Eigen::Vector3d x(x_low + u * (x_high - x_low), y_low + v * (y_high - y_low), z);
        return Eigen::Vector3d(x.x(), x.y(), z + bumps * FractalNoise(x.cast<float>(), 1.0F, 0.5F, 0.2F, salt));
      },
      [&](double u, double v) { return Eigen::Vector2d(x_low + u * (x_high - x_low), y_low + v * (y_high - y_low)); });
}

}  // namespace

Stage BuildStreet(const SyntheticOptions& options) {
  HashRandom random(HashBits(options.seed, 103));
  const auto salt = static_cast<uint32_t>(random.Bits());
  const int stations = (options.cameras + 1) / 2;
  const double x_low = -3;
  const double x_high = stations * kStationStep + 18;
  WorldBuilder builder;
  const SurfaceFrame left{.origin = {x_low, kHalfWidth, 0}};
  const SurfaceFrame right{
      .origin = {x_high, -kHalfWidth, 0}, .s = -Eigen::Vector3d::UnitX(), .o = Eigen::Vector3d::UnitY()};
  AddRow(builder, left, x_high - x_low, random);
  AddRow(builder, right, x_high - x_low, random);
  AddGroundStrip(builder, x_low, x_high, -3.5, 3.5, -0.13, 0.02, Material::kGround, salt);
  AddGroundStrip(builder, x_low, x_high, 3.5, kHalfWidth + 1.3, 0, 0.003, Material::kPaving, salt + 1);
  AddGroundStrip(builder, x_low, x_high, -kHalfWidth - 1.3, -3.5, 0, 0.003, Material::kPaving, salt + 2);
  for (const SurfaceFrame& side : {left, right}) {
    // Kerb, posts and lamps stand before the houses.
    builder.AddBox(side, {0, -0.3, kHalfWidth - 3.5 - 0.01}, {x_high - x_low, 0.005, kHalfWidth - 3.5 + 0.14},
                   Material::kRoughStone);
    for (double s = 2; s < x_high - x_low; s += random.Uniform(3.0, 6.0)) {
      const bool lamp = random.Index(3) == 0;
      const double height = lamp ? 4.2 : 0.9;
      const double radius = lamp ? 0.07 : 0.12;
      builder.AddColumn(side, {s, 0, 1.7}, height, 24, 24, lamp ? Material::kPlanks : Material::kRoughStone,
                        [=](double v, double) { return radius * (v < 0.1 || v > 0.93 ? 1.5 : 1.0 - 0.2 * v); });
    }
  }

  Stage stage;
  stage.world = std::move(builder.world());
  stage.world.to_sun = Eigen::Vector3f(0.35F, -0.45F, 1.0F).normalized();
  stage.world.sun = 0.85F;
  stage.world.ambient = 0.48F;
  stage.world.sky_low = {0.66F, 0.72F, 0.80F};
  stage.world.sky_high = {0.26F, 0.42F, 0.68F};

  for (int i = 0; i < options.cameras; ++i) {
    const int station = i / 2;
    const double side = i % 2 == 0 ? 1 : -1;
    const double yaw = side * (kYaw + random.Uniform(-0.05, 0.05));
    const double y = 0.6 * std::sin(0.3 * i) + random.Uniform(-0.2, 0.2);
    const Eigen::Vector3d center(station * kStationStep + random.Uniform(-0.1, 0.1), y,
                                 1.65 + random.Uniform(-0.06, 0.06));
    const Eigen::Vector3d axis(std::cos(yaw), std::sin(yaw), 0.14 + random.Uniform(-0.03, 0.03));
    stage.cameras.push_back(LookAt(options, 0.72 * std::max(options.width, options.height), center, center + axis));
  }
  // In the files the walk is in no order.
  for (size_t i = stage.cameras.size(); i > 1; --i) {
    std::swap(stage.cameras[i - 1], stage.cameras[static_cast<size_t>(random.Index(static_cast<int>(i)))]);
  }
  return stage;
}

}  // namespace meshwright
