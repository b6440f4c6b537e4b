// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "tools/synthetic/world.h"

namespace meshwright {

// One house front of two or three storeys. Lengths in m.
struct HouseStyle {
  double width = 12;
  double height = 8;
  int windows = 5;  // per storey; the middle one of the ground floor is the door
  int storeys = 2;
  Material ground_floor = Material::kAshlar;
  Material upper_floors = Material::kBrick;
  Material panel = Material::kPlaster;  // every third field between windows of the upper floors
  double recess = 0.28;                 // depth of the windows
  bool frieze = true;                   // carved band above the ground floor
  bool balcony = false;                 // before the door, on two columns
  double spacing = 0.06;                // of the tessellation
};

// The front stands at frame: s from 0 to width, t from 0 to height, o = 0 the plane of the wall.
void AddHouse(WorldBuilder& builder, const SurfaceFrame& frame, const HouseStyle& style, uint32_t salt);

}  // namespace meshwright
