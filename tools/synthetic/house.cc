// SPDX-License-Identifier: Apache-2.0
#include "tools/synthetic/house.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace meshwright {
namespace {

struct Plan {
  double base = 0.6;   // height of the plinth
  double storey = 0;   // height of a storey
  double cornice = 0;  // height at which the cornice begins
  double bay = 0;      // width that belongs to a window
  double window_width = 0;
  double band = 0.5;  // height of the band between ground floor and upper floors

  double WindowLeft(int window) const { return (window + 0.5) * bay - 0.5 * window_width; }
  double Floor(int floor) const { return floor == 0 ? base : base + floor * storey; }
  double Sill(int floor) const { return Floor(floor) + (floor == 0 ? 0.5 : band + 0.35); }
  double Lintel(int floor) const { return Floor(floor + 1) - 0.45; }
};

Plan PlanOf(const HouseStyle& style) {
  Plan plan;
  plan.cornice = style.height - 0.8;
  plan.storey = (plan.cornice - plan.base) / style.storeys;
  plan.bay = style.width / style.windows;
  plan.window_width = std::min(1.2, 0.5 * plan.bay);
  return plan;
}

// A row of turned posts under a rail, s from low to high.
void AddBalustrade(WorldBuilder& builder, const SurfaceFrame& frame, double s_low, double s_high, double foot,
                   double out) {
  const int posts = std::max(2, static_cast<int>((s_high - s_low) / 0.22));
  for (int i = 0; i < posts; ++i) {
    const double s = s_low + (i + 0.5) * (s_high - s_low) / posts;
    builder.AddColumn(frame, {s, foot, out}, 0.62, 16, 14, Material::kMarble, [](double v, double) {
      const double belly = std::sin(3.1 * std::min(1.0, 1.3 * v));
      return 0.028 + 0.045 * belly * belly + (v < 0.08 || v > 0.92 ? 0.03 : 0.0);
    });
  }
  builder.AddBox(frame, {s_low - 0.05, foot + 0.62, out - 0.09}, {s_high + 0.05, foot + 0.76, out + 0.09},
                 Material::kRoughStone);
}

void AddPorch(WorldBuilder& builder, const SurfaceFrame& frame, const Plan& plan, double middle) {
  const double top = plan.Floor(1) - 0.02;
  const double foot = 0.36;
  const double half = 0.75 * plan.bay;
  for (const double side : {-1.0, 1.0}) {
    const double s = middle + side * 0.5 * plan.bay;
    builder.AddBox(frame, {s - 0.27, foot, 0.56}, {s + 0.27, foot + 0.22, 1.10}, Material::kRoughStone);
    builder.AddColumn(frame, {s, foot + 0.22, 0.83}, top - foot - 0.57, 96, 40, Material::kMarble,
                      [](double v, double angle) {
                        const double flutes = 0.010 * std::abs(std::sin(8 * angle));
                        const double swell = 0.205 - 0.03 * v * v;
                        const bool ring = v < 0.04 || v > 0.95;
                        return ring ? 0.24 : swell - flutes;
                      });
    builder.AddBox(frame, {s - 0.26, top - 0.35, 0.57}, {s + 0.26, top - 0.22, 1.09}, Material::kRoughStone);
  }
  builder.AddBox(frame, {middle - half, top - 0.22, -0.1}, {middle + half, top + 0.06, 1.18}, Material::kRoughStone);
  AddBalustrade(builder, frame, middle - half + 0.1, middle + half - 0.1, top + 0.06, 1.05);
  builder.AddBox(frame, {middle - half - 0.2, -0.2, -0.5}, {middle + half + 0.2, 0.12, 1.9}, Material::kRoughStone);
  builder.AddBox(frame, {middle - half - 0.1, 0.1, -0.5}, {middle + half + 0.1, 0.24, 1.6}, Material::kRoughStone);
  builder.AddBox(frame, {middle - half, 0.2, -0.5}, {middle + half, foot, 1.3}, Material::kRoughStone);
}

void AddWindowBars(WorldBuilder& builder, const SurfaceFrame& frame, double left, double right, double low, double high,
                   double out) {
  const double bar = 0.035;
  const double middle = 0.5 * (left + right);
  builder.AddBox(frame, {left, low, out}, {left + 2 * bar, high, out + 0.07}, Material::kPaint);
  builder.AddBox(frame, {right - 2 * bar, low, out}, {right, high, out + 0.07}, Material::kPaint);
  builder.AddBox(frame, {middle - bar, low, out}, {middle + bar, high, out + 0.09}, Material::kPaint);
  builder.AddBox(frame, {left, high - 2 * bar, out}, {right, high, out + 0.07}, Material::kPaint);
  builder.AddBox(frame, {left, low, out}, {right, low + 2 * bar, out + 0.07}, Material::kPaint);
  for (const double part : {0.4, 0.72}) {
    const double t = low + part * (high - low);
    builder.AddBox(frame, {left, t - 0.6 * bar, out}, {right, t + 0.6 * bar, out + 0.06}, Material::kPaint);
  }
}

}  // namespace

void AddHouse(WorldBuilder& builder, const SurfaceFrame& frame, const HouseStyle& style, uint32_t salt) {
  const Plan plan = PlanOf(style);
  const int door = style.windows / 2;
  const double pilaster = std::min(0.36, 0.2 * plan.bay);

  // Lines of the plan: windows and pilasters across; plinth, windows, bands and cornice upwards.
  std::vector<double> s_lines = {0, 0.5 * pilaster};
  for (int w = 0; w < style.windows; ++w) {
    s_lines.push_back(plan.WindowLeft(w));
    s_lines.push_back(plan.WindowLeft(w) + plan.window_width);
    s_lines.push_back((w + 1) * plan.bay - 0.5 * pilaster);
    if (w + 1 < style.windows) s_lines.push_back((w + 1) * plan.bay + 0.5 * pilaster);
  }
  s_lines.push_back(style.width);
  std::vector<double> t_lines = {0, plan.base};
  for (int floor = 0; floor < style.storeys; ++floor) {
    if (floor > 0) {
      t_lines.push_back(plan.Floor(floor));
      t_lines.push_back(plan.Floor(floor) + plan.band);
    }
    t_lines.push_back(plan.Sill(floor));
    t_lines.push_back(plan.Lintel(floor));
  }
  t_lines.push_back(plan.cornice);
  t_lines.push_back(plan.cornice + 0.3);
  t_lines.push_back(style.height);

  const auto middle_of = [](const std::vector<double>& lines, int i) {
    return 0.5 * (lines[static_cast<size_t>(i)] + lines[static_cast<size_t>(i) + 1]);
  };
  const auto cell = [&](int i, int j) {
    const double s = middle_of(s_lines, i);
    const double t = middle_of(t_lines, j);
    const int bay = std::clamp(static_cast<int>(s / plan.bay), 0, style.windows - 1);
    const int floor = std::clamp(static_cast<int>((t - plan.base) / plan.storey), 0, style.storeys - 1);
    const double from_window = s - plan.WindowLeft(bay);
    const bool in_window_column = from_window > 0 && from_window < plan.window_width;
    const bool on_pilaster = std::abs(s - std::round(s / plan.bay) * plan.bay) < 0.5 * pilaster;
    ReliefCell c;
    if (in_window_column && floor == 0 && bay == door && t < plan.Lintel(0)) {
      c.out = -1.8 * style.recess;
      c.material = Material::kPlanks;
    } else if (t < plan.base) {
      c = {.out = 0.14, .material = Material::kRoughStone, .roughness = 0.025, .bump_size = 0.35};
    } else if (t > plan.cornice + 0.3) {
      c = {.out = 0.03, .material = style.panel};
    } else if (t > plan.cornice) {
      c = {.out = 0.34, .material = Material::kRoughStone};
    } else if (floor > 0 && t < plan.Floor(floor) + plan.band) {
      c = {.out = 0.10, .material = Material::kMarble, .ornament = style.frieze && floor == 1 ? 0.05 : 0.0};
    } else if (in_window_column && t > plan.Sill(floor) && t < plan.Lintel(floor)) {
      // Behind most panes hang curtains; every fourth window is bare glass, which nothing can reconstruct.
      const bool bare = (bay + 2 * floor) % 4 == 1;
      c = {.out = -style.recess, .material = bare ? Material::kGlass : Material::kCurtain};
    } else if (floor == 0) {
      c = {.out = 0, .material = style.ground_floor, .roughness = 0.012, .bump_size = 0.3};
    } else if (on_pilaster) {
      c = {.out = 0.12, .material = Material::kRoughStone, .roughness = 0.006, .bump_size = 0.2};
    } else {
      const bool is_panel = !in_window_column && (bay + floor) % 3 == 0;
      c = {.out = is_panel ? -0.03 : 0.0, .material = is_panel ? style.panel : style.upper_floors};
    }
    return c;
  };
  AddRelief(builder, frame, s_lines, t_lines, cell, style.spacing, -1.0, salt);

  for (int floor = 0; floor < style.storeys; ++floor) {
    for (int w = 0; w < style.windows; ++w) {
      if (floor == 0 && w == door) continue;
      const double left = plan.WindowLeft(w);
      const double right = left + plan.window_width;
      AddWindowBars(builder, frame, left, right, plan.Sill(floor), plan.Lintel(floor), -style.recess - 0.01);
      builder.AddBox(frame, {left - 0.12, plan.Sill(floor) - 0.11, -style.recess},
                     {right + 0.12, plan.Sill(floor), 0.17}, Material::kRoughStone);
      builder.AddBox(frame, {left - 0.08, plan.Lintel(floor), -0.1}, {right + 0.08, plan.Lintel(floor) + 0.16, 0.09},
                     Material::kMarble);
    }
  }
  if (style.balcony) AddPorch(builder, frame, plan, (door + 0.5) * plan.bay);
}

}  // namespace meshwright
