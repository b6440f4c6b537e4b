// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include <Eigen/Core>

#include "tools/synthetic/material.h"

#include "common/mesh/triangle_mesh.h"

namespace meshwright {

// A small bright lamp; it casts no shadows.
struct Lamp {
  Eigen::Vector3f position = Eigen::Vector3f::Zero();  // scene units
  float power = 1;                                     // irradiance of a surface that faces it at a distance of `unit`
};

// A synthetic world: exact geometry with what it is made of and how it is lit.
struct World {
  TriangleMesh mesh;                                  // positions, normals (for shading), faces
  std::vector<Eigen::Vector2f> uv;                    // per vertex; position on the surface, scene units
  std::vector<Material> material;                     // per face
  float unit = 1;                                     // scene units in which the materials' sizes are metres
  Eigen::Vector3f to_sun = Eigen::Vector3f::UnitZ();  // unit
  float sun = 1;                                      // irradiance of a surface across the sun's rays
  std::vector<Lamp> lamps;
  float ambient = 0.3F;                                // irradiance from the sky
  Eigen::Vector3f sky_low = Eigen::Vector3f::Zero();   // background at the horizon, linear RGB
  Eigen::Vector3f sky_high = Eigen::Vector3f::Zero();  // background at the zenith
};

// A frame on a surface: `s` along it, `t` up, `o` outwards (right-handed).
struct SurfaceFrame {
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();
  Eigen::Vector3d s = Eigen::Vector3d::UnitX();
  Eigen::Vector3d t = Eigen::Vector3d::UnitZ();
  Eigen::Vector3d o = -Eigen::Vector3d::UnitY();

  Eigen::Vector3d At(double along, double up, double out) const { return origin + along * s + up * t + out * o; }
};

// Puts pieces of surface into a world. All faces are counter-clockwise seen from outside.
class WorldBuilder {
 public:
  // A grid of columns x rows cells over (u, v) in [0, 1]^2; `position` goes to the right with u and up with v as seen
  // from outside. Normals are those of the smooth surface. uv is measured along the grid's lines, or given.
  void AddGrid(int columns, int rows, Material material,
               const std::function<Eigen::Vector3d(double u, double v)>& position,
               const std::function<Eigen::Vector2d(double u, double v)>& uv = nullptr);

  // All six sides. Corners in the frame: (s, t, o).
  void AddBox(const SurfaceFrame& frame, const Eigen::Vector3d& low, const Eigen::Vector3d& high, Material material);

  // Surface of revolution around frame.t through `foot` = (s, t, o); `radius` as a function of height fraction and
  // angle. Open at the ends.
  void AddColumn(const SurfaceFrame& frame, const Eigen::Vector3d& foot, double height, int around, int along,
                 Material material, const std::function<double(double v, double angle)>& radius);

  World& world() { return world_; }

 private:
  World world_;
};

// A plan of a wall: rectangles between lines, each at its own depth.
struct ReliefCell {
  double out = 0;  // in front of the frame's plane
  Material material = Material::kRoughStone;
  double roughness = 0;  // amplitude of bumps of `bump_size`
  double bump_size = 0.25;
  double ornament = 0;  // amplitude of a regular carved pattern
};

// A wall of rectangular cells at different depths, closed by the steps between them, tessellated at about `spacing`.
// cell(i, j) describes [s_lines[i], s_lines[i + 1]] x [t_lines[j], t_lines[j + 1]]. The outer border is drawn back to
// `border_out`.
void AddRelief(WorldBuilder& builder, const SurfaceFrame& frame, const std::vector<double>& s_lines,
               const std::vector<double>& t_lines, const std::function<ReliefCell(int i, int j)>& cell, double spacing,
               double border_out, uint32_t salt);

}  // namespace meshwright
