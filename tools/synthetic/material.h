// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include <Eigen/Core>

namespace meshwright {

// What a surface of the synthetic world is made of. Names say what the photographs are to contain: texture at every
// scale, repetitive texture, or next to none.
enum class Material : uint8_t {
  kRoughStone,   // texture at every scale
  kAshlar,       // cut blocks with joints, each block of its own tone
  kBrick,        // repetitive: small blocks, nearly the same
  kPlaster,      // nearly untextured
  kPaint,        // untextured: only shading
  kStuccoStain,  // plaster with stains of large wavelength only
  kPlanks,       // repetitive: stripes
  kGlass,        // dark, untextured
  kCurtain,      // behind glass: soft cloth with folds
  kGround,       // gravel: strong fine texture
  kPaving,       // repetitive: square slabs
  kMarble,       // veins
  kLacquer,      // untextured, with highlights that move with the camera
  kCount
};

// Share of the light that the surface mirrors as a highlight, 0..1; most materials are matt.
float Gloss(Material material);

// Diffuse reflectance (linear RGB, 0..1) at a surface point. `x`: world position, `uv`: position on the surface (both
// in scene units), `unit`: scene units in which the material's own sizes (a brick, a vein) are metres, `footprint`:
// scene units that a pixel covers; nothing finer is drawn, so two views agree on a point's colour.
Eigen::Vector3f Reflectance(Material material, const Eigen::Vector3f& x, const Eigen::Vector2f& uv, float unit,
                            float footprint, uint32_t salt);

}  // namespace meshwright
