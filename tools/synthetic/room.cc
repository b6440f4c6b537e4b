// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include <Eigen/Geometry>

#include "tools/synthetic/hash_noise.h"
#include "tools/synthetic/stage.h"

namespace meshwright {
namespace {

constexpr double kLength = 6.4;  // m, along x
constexpr double kWidth = 5.2;   // m, along y
constexpr double kHeight = 2.7;  // m

// The walls as seen from inside: s to the right, o into the room.
const SurfaceFrame kNorth{.origin = {0, kWidth, 0}};
const SurfaceFrame kSouth{.origin = {kLength, 0, 0}, .s = -Eigen::Vector3d::UnitX(), .o = Eigen::Vector3d::UnitY()};
const SurfaceFrame kEast{
    .origin = {kLength, kWidth, 0}, .s = -Eigen::Vector3d::UnitY(), .o = -Eigen::Vector3d::UnitX()};
const SurfaceFrame kWest{.origin = {0, 0, 0}, .s = Eigen::Vector3d::UnitY(), .o = Eigen::Vector3d::UnitX()};

void AddWall(WorldBuilder& builder, const SurfaceFrame& wall, double length) {
  builder.AddGrid(16, 8, Material::kPlaster, [&](double u, double v) { return wall.At(u * length, v * kHeight, 0); });
  builder.AddBox(wall, {0, -0.1, -0.1}, {length, 0.09, 0.018}, Material::kPlanks);  // skirting board
}

void AddShell(WorldBuilder& builder) {
  AddWall(builder, kNorth, kLength);
  AddWall(builder, kSouth, kLength);
  AddWall(builder, kEast, kWidth);
  AddWall(builder, kWest, kWidth);
  const auto floor_uv = [](double u, double v) { return Eigen::Vector2d(v * kWidth, u * kLength); };
  builder.AddGrid(
      16, 16, Material::kPlanks, [](double u, double v) { return Eigen::Vector3d(u * kLength, v * kWidth, 0); },
      floor_uv);
  builder.AddGrid(16, 16, Material::kPaint,
                  [](double u, double v) { return Eigen::Vector3d(v * kLength, u * kWidth, kHeight); });
}

// A row of lacquered doors with dark gaps and handles; s and t from low to high, `out` the depth.
void AddCupboards(WorldBuilder& builder, const SurfaceFrame& wall, double s_low, double s_high, double t_low,
                  double t_high, double out) {
  builder.AddBox(wall, {s_low, t_low, -0.05}, {s_high, t_high, out}, Material::kLacquer);
  const int doors = std::max(1, static_cast<int>(std::lround((s_high - s_low) / 0.55)));
  for (int i = 0; i <= doors; ++i) {
    const double s = s_low + i * (s_high - s_low) / doors;
    if (i > 0 && i < doors) {
      builder.AddBox(wall, {s - 0.004, t_low + 0.01, out}, {s + 0.004, t_high - 0.01, out + 0.001}, Material::kGlass);
    }
    if (i == doors) continue;
    const double middle = s + 0.5 * (s_high - s_low) / doors;
    const double t = t_low > 1 ? t_low + 0.08 : t_high - 0.08;
    builder.AddBox(wall, {middle - 0.09, t - 0.012, out}, {middle + 0.09, t + 0.012, out + 0.03}, Material::kGlass);
  }
}

void AddPicture(WorldBuilder& builder, const SurfaceFrame& wall, double s, double t, double width, double height,
                Material picture) {
  const double half_s = 0.5 * width;
  const double half_t = 0.5 * height;
  builder.AddBox(wall, {s - half_s, t - half_t, -0.01}, {s + half_s, t + half_t, 0.02}, picture);
  const double bar = 0.05;
  builder.AddBox(wall, {s - half_s - bar, t - half_t - bar, -0.01}, {s - half_s, t + half_t + bar, 0.035},
                 Material::kPlanks);
  builder.AddBox(wall, {s + half_s, t - half_t - bar, -0.01}, {s + half_s + bar, t + half_t + bar, 0.035},
                 Material::kPlanks);
  builder.AddBox(wall, {s - half_s, t + half_t, -0.01}, {s + half_s, t + half_t + bar, 0.035}, Material::kPlanks);
  builder.AddBox(wall, {s - half_s, t - half_t - bar, -0.01}, {s + half_s, t - half_t, 0.035}, Material::kPlanks);
}

void AddBookshelf(WorldBuilder& builder, const SurfaceFrame& wall, double s_low, double s_high, HashRandom& random) {
  constexpr Material kBindings[] = {Material::kBrick, Material::kMarble, Material::kStuccoStain, Material::kCurtain,
                                    Material::kRoughStone};
  constexpr double kDepth = 0.3;
  for (const double s : {s_low, s_high - 0.03}) {
    builder.AddBox(wall, {s, 0, -0.02}, {s + 0.03, 2.1, kDepth}, Material::kPlanks);
  }
  for (int shelf = 0; shelf <= 5; ++shelf) {
    const double t = 0.1 + 0.395 * shelf;
    builder.AddBox(wall, {s_low, t - 0.025, -0.02}, {s_high, t, kDepth}, Material::kPlanks);
    if (shelf == 5) break;
    for (double s = s_low + 0.05; s < s_high - 0.12;) {
      const double thickness = random.Uniform(0.03, 0.07);
      const double height = random.Uniform(0.2, 0.33);
      builder.AddBox(wall, {s, t, 0}, {s + thickness, t + height, random.Uniform(0.18, 0.26)},
                     kBindings[random.Index(5)]);
      s += thickness + (random.Index(9) == 0 ? random.Uniform(0.05, 0.2) : 0.003);
    }
  }
}

// A profile that closes at the top, so that nobody looks into the inside of a surface without thickness.
double Closed(double radius, double v) { return v > 0.92 ? std::max(0.002, radius * (1 - v) / 0.08) : radius; }

void AddTable(WorldBuilder& builder, const Eigen::Vector3d& middle) {
  const SurfaceFrame frame{.origin = middle};
  builder.AddBox(frame, {-0.7, 0.71, -0.4}, {0.7, 0.75, 0.4}, Material::kPlanks);
  for (const double s : {-0.62, 0.62}) {
    for (const double o : {-0.33, 0.33}) {
      builder.AddBox(frame, {s - 0.03, 0, o - 0.03}, {s + 0.03, 0.71, o + 0.03}, Material::kPlanks);
    }
  }
  builder.AddColumn(frame, {0.3, 0.75, 0.05}, 0.26, 48, 24, Material::kMarble,
                    [](double v, double) { return Closed(0.05 + 0.05 * std::sin(2.6 * v + 0.3), v); });
  builder.AddColumn(frame, {-0.25, 0.75, -0.1}, 0.13, 48, 12, Material::kBrick,
                    [](double v, double) { return Closed(0.07 + 0.09 * v, v); });
}

void AddSofa(WorldBuilder& builder, const SurfaceFrame& wall, double s_low, double s_high) {
  builder.AddBox(wall, {s_low, 0, 0.05}, {s_high, 0.42, 0.9}, Material::kCurtain);
  builder.AddBox(wall, {s_low, 0.42, 0.05}, {s_high, 0.85, 0.3}, Material::kCurtain);
  builder.AddBox(wall, {s_low - 0.18, 0, 0.05}, {s_low, 0.6, 0.9}, Material::kCurtain);
  builder.AddBox(wall, {s_high, 0, 0.05}, {s_high + 0.18, 0.6, 0.9}, Material::kCurtain);
}

void AddLamp(WorldBuilder& builder, const Eigen::Vector3d& foot, double height) {
  const SurfaceFrame frame{.origin = foot};
  builder.AddColumn(frame, {0, 0, 0}, height - 0.3, 16, 4, Material::kGlass, [](double, double) { return 0.015; });
  builder.AddColumn(frame, {0, height - 0.34, 0}, 0.34, 48, 12, Material::kStuccoStain,
                    [](double v, double) { return Closed(0.24 - 0.10 * v, v); });
}

}  // namespace

Stage BuildRoom(const SyntheticOptions& options) {
  HashRandom random(HashBits(options.seed, 104));
  WorldBuilder builder;
  AddShell(builder);
  AddCupboards(builder, kNorth, 0.4, 3.2, 0.08, 0.88, 0.55);
  builder.AddBox(kNorth, {0.35, 0.88, -0.05}, {3.25, 0.92, 0.6}, Material::kMarble);  // worktop
  AddCupboards(builder, kNorth, 0.4, 3.2, 1.5, 2.2, 0.34);
  AddPicture(builder, kNorth, 4.6, 1.6, 0.9, 0.65, Material::kStuccoStain);
  AddBookshelf(builder, kEast, 0.7, 2.9, random);
  AddPicture(builder, kEast, 4.0, 1.6, 0.5, 0.7, Material::kMarble);
  AddSofa(builder, kSouth, 1.2, 3.2);
  AddPicture(builder, kSouth, 2.2, 1.7, 1.2, 0.6, Material::kRoughStone);
  builder.AddBox(kSouth, {4.3, 0.4, -0.02}, {5.6, 2.2, 0.05}, Material::kCurtain);  // a curtain before a window
  builder.AddBox(kWest, {1.0, 0, -0.05}, {1.9, 2.05, 0.03}, Material::kPaint);      // the door
  builder.AddBox(kWest, {0.92, 0, -0.05}, {1.0, 2.12, 0.06}, Material::kPlanks);
  builder.AddBox(kWest, {1.9, 0, -0.05}, {1.98, 2.12, 0.06}, Material::kPlanks);
  builder.AddBox(kWest, {0.92, 2.05, -0.05}, {1.98, 2.12, 0.06}, Material::kPlanks);
  AddPicture(builder, kWest, 3.4, 1.6, 0.8, 0.8, Material::kAshlar);
  AddTable(builder, {3.2, 2.7, 0});
  builder.AddBox({.origin = {3.2, 2.7, 0}}, {-1.3, -0.01, -0.9}, {1.3, 0.012, 0.9}, Material::kAshlar);  // a carpet
  AddLamp(builder, {0.55, 4.0, 0}, 1.7);
  AddLamp(builder, {5.8, 0.5, 0}, 1.6);

  Stage stage;
  stage.world = std::move(builder.world());
  stage.world.sun = 0;
  stage.world.ambient = 0.45F;
  stage.world.lamps = {{.position = {1.7F, 2.3F, 2.55F}, .power = 1.1F},
                       {.position = {4.7F, 2.9F, 2.55F}, .power = 1.1F}};

  // A walk around the table at the height of the eyes, looking outwards, a little to the left and to the right by
  // turns.
  for (int i = 0; i < options.cameras; ++i) {
    const double angle = 2 * std::numbers::pi * (i + random.Uniform(-0.2, 0.2)) / options.cameras;
    const Eigen::Vector3d center(3.2 + 1.75 * std::cos(angle), 2.6 + 1.35 * std::sin(angle),
                                 1.6 + random.Uniform(-0.12, 0.12));
    // Across the room: the table comes into view, and walls are seen from further away.
    const double yaw = angle + std::numbers::pi + (i % 2 == 0 ? 0.45 : -0.45) + random.Uniform(-0.05, 0.05);
    const Eigen::Vector3d axis(std::cos(yaw), std::sin(yaw), -0.16 + random.Uniform(-0.05, 0.05));
    stage.cameras.push_back(LookAt(options, 0.68 * std::max(options.width, options.height), center, center + axis));
  }
  return stage;
}

}  // namespace meshwright
