// SPDX-License-Identifier: Apache-2.0
#include "tools/synthetic/world.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include <Eigen/Geometry>

#include "tools/synthetic/hash_noise.h"

namespace meshwright {

void WorldBuilder::AddGrid(int columns, int rows, Material material,
                           const std::function<Eigen::Vector3d(double, double)>& position,
                           const std::function<Eigen::Vector2d(double, double)>& uv) {
  const auto first = static_cast<uint32_t>(world_.mesh.positions.size());
  for (int j = 0; j <= rows; ++j) {
    for (int i = 0; i <= columns; ++i) {
      const double u = static_cast<double>(i) / columns;
      const double v = static_cast<double>(j) / rows;
      const double du = 0.25 / columns;
      const double dv = 0.25 / rows;
      const Eigen::Vector3d along = position(u + du, v) - position(u - du, v);
      const Eigen::Vector3d up = position(u, v + dv) - position(u, v - dv);
      const Eigen::Vector3d x = position(u, v);
      world_.mesh.positions.emplace_back(x.cast<float>());
      world_.mesh.normals.emplace_back(along.cross(up).stableNormalized().cast<float>());
      if (uv != nullptr) {
        world_.uv.emplace_back(uv(u, v).cast<float>());
      } else {
        const Eigen::Vector3d left = position(0, v);
        const Eigen::Vector3d bottom = position(u, 0);
        world_.uv.emplace_back(static_cast<float>((x - left).norm()), static_cast<float>((x - bottom).norm()));
      }
    }
  }
  const auto stride = static_cast<uint32_t>(columns + 1);
  for (uint32_t j = 0; j < static_cast<uint32_t>(rows); ++j) {
    for (uint32_t i = 0; i < static_cast<uint32_t>(columns); ++i) {
      const uint32_t corner = first + j * stride + i;
      world_.mesh.faces.push_back({corner, corner + 1, corner + stride + 1});
      world_.mesh.faces.push_back({corner, corner + stride + 1, corner + stride});
      world_.material.insert(world_.material.end(), 2, material);
    }
  }
}

void WorldBuilder::AddBox(const SurfaceFrame& frame, const Eigen::Vector3d& low, const Eigen::Vector3d& high,
                          Material material) {
  // Corner, right and up of each side as seen from outside.
  const Eigen::Vector3d size = high - low;
  const Eigen::Vector3d s(size.x(), 0, 0);
  const Eigen::Vector3d t(0, size.y(), 0);
  const Eigen::Vector3d o(0, 0, size.z());
  const std::array<std::array<Eigen::Vector3d, 3>, 6> sides = {{
      {low + o, s, t},       // front
      {low + s, -s, t},      // back
      {low + s + o, -o, t},  // right
      {low, o, t},           // left
      {low + t + o, s, -o},  // top
      {low, s, o},           // bottom
  }};
  for (const auto& [corner, right, up] : sides) {
    AddGrid(1, 1, material, [&, corner = corner, right = right, up = up](double u, double v) {
      const Eigen::Vector3d x = corner + u * right + v * up;
      return frame.At(x.x(), x.y(), x.z());
    });
  }
}

void WorldBuilder::AddColumn(const SurfaceFrame& frame, const Eigen::Vector3d& foot, double height, int around,
                             int along, Material material, const std::function<double(double, double)>& radius) {
  AddGrid(
      around, along, material,
      [&](double u, double v) {
        const double angle = 2 * std::numbers::pi * u;
        const double r = radius(std::clamp(v, 0.0, 1.0), angle);
        return frame.At(foot.x() + r * std::sin(angle), foot.y() + v * height, foot.z() + r * std::cos(angle));
      },
      [&](double u, double v) {
        return Eigen::Vector2d(2 * std::numbers::pi * u * radius(v, 2 * std::numbers::pi * u), v * height);
      });
}

namespace {

// A carved pattern: rows of discs and leaves.
double Ornament(double s, double t) {
  const double a = std::sin(9.0 * s) * std::cos(11.0 * t + 2.0 * std::sin(4.5 * s));
  const double b = std::cos(21.0 * s + 3.0 * std::sin(7.0 * t));
  return 0.7 * a + 0.3 * b * b;
}

int Pieces(double length, double spacing) { return std::max(1, static_cast<int>(std::lround(length / spacing))); }

}  // namespace

void AddRelief(WorldBuilder& builder, const SurfaceFrame& frame, const std::vector<double>& s_lines,
               const std::vector<double>& t_lines, const std::function<ReliefCell(int, int)>& cell, double spacing,
               double border_out, uint32_t salt) {
  const int columns = static_cast<int>(s_lines.size()) - 1;
  const int rows = static_cast<int>(t_lines.size()) - 1;
  const auto s_line = [&](int i) { return s_lines[static_cast<size_t>(i)]; };
  const auto t_line = [&](int j) { return t_lines[static_cast<size_t>(j)]; };
  const auto height = [salt](const ReliefCell& c, double s, double t) {
    double out = c.out;
    if (c.roughness > 0) {
      const Eigen::Vector3d x = Eigen::Vector3d(s, t, c.out) / c.bump_size;
      out += c.roughness * FractalNoise(x.cast<float>(), 1.0F, 0.5F, 0.1F, salt);
    }
    if (c.ornament > 0) out += c.ornament * Ornament(s, t);
    return out;
  };
  for (int j = 0; j < rows; ++j) {
    for (int i = 0; i < columns; ++i) {
      const ReliefCell c = cell(i, j);
      const double width = s_line(i + 1) - s_line(i);
      const double rise = t_line(j + 1) - t_line(j);
      const auto s_at = [&, i](double u) { return s_line(i) + u * width; };
      const auto t_at = [&, j](double v) { return t_line(j) + v * rise; };
      builder.AddGrid(
          Pieces(width, spacing), Pieces(rise, spacing), c.material,
          [&](double u, double v) { return frame.At(s_at(u), t_at(v), height(c, s_at(u), t_at(v))); },
          [&](double u, double v) { return Eigen::Vector2d(s_at(u), t_at(v)); });
    }
  }
  // Steps: strips along the lines between neighbouring cells, facing the lower one.
  const auto same = [](const ReliefCell& a, const ReliefCell& b) {
    return a.out == b.out && a.roughness == b.roughness && a.bump_size == b.bump_size && a.ornament == b.ornament;
  };
  ReliefCell border;
  border.out = border_out;
  for (int j = 0; j < rows; ++j) {
    for (int i = 0; i <= columns; ++i) {
      const ReliefCell left = i > 0 ? cell(i - 1, j) : border;
      const ReliefCell right = i < columns ? cell(i, j) : border;
      if (same(left, right)) continue;
      const double s = s_line(i);
      const double rise = t_line(j + 1) - t_line(j);
      const bool faces_right = left.out > right.out;
      builder.AddGrid(
          1, Pieces(rise, spacing), faces_right ? left.material : right.material,
          [&](double u, double v) {
            const double t = t_line(j) + v * rise;
            return frame.At(s, t, (1 - u) * height(left, s, t) + u * height(right, s, t));
          },
          [&](double u, double v) {
            return Eigen::Vector2d(s + (1 - u) * left.out + u * right.out, t_line(j) + v * rise);
          });
    }
  }
  for (int i = 0; i < columns; ++i) {
    for (int j = 0; j <= rows; ++j) {
      const ReliefCell below = j > 0 ? cell(i, j - 1) : border;
      const ReliefCell above = j < rows ? cell(i, j) : border;
      if (same(below, above)) continue;
      const double t = t_line(j);
      const double width = s_line(i + 1) - s_line(i);
      builder.AddGrid(
          Pieces(width, spacing), 1, below.out > above.out ? below.material : above.material,
          [&](double u, double v) {
            const double s = s_line(i) + u * width;
            return frame.At(s, t, (1 - v) * height(below, s, t) + v * height(above, s, t));
          },
          [&](double u, double v) {
            return Eigen::Vector2d(s_line(i) + u * width, t + (1 - v) * below.out + v * above.out);
          });
    }
  }
}

}  // namespace meshwright
