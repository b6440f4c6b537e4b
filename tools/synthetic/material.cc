// SPDX-License-Identifier: Apache-2.0
#include "tools/synthetic/material.h"

#include <algorithm>
#include <cmath>

#include "tools/synthetic/hash_noise.h"

namespace meshwright {
namespace {

// Base colours in linear RGB.
struct Recipe {
  float red, green, blue;
  float contrast;     // of the fractal noise
  float persistence;  // how strong the fine octaves are
  float largest;      // m; wavelength of the first octave
  float tint;         // how far the hue wanders
};

constexpr Recipe kRecipes[static_cast<int>(Material::kCount)] = {
    {0.42F, 0.37F, 0.30F, 0.17F, 1.00F, 1.6F, 0.10F},   // kRoughStone
    {0.46F, 0.41F, 0.33F, 0.13F, 1.02F, 0.9F, 0.08F},   // kAshlar
    {0.36F, 0.15F, 0.10F, 0.14F, 1.00F, 0.7F, 0.10F},   // kBrick
    {0.62F, 0.57F, 0.46F, 0.018F, 0.75F, 2.5F, 0.02F},  // kPlaster
    {0.60F, 0.61F, 0.58F, 0.008F, 0.50F, 2.0F, 0.01F},  // kPaint
    {0.55F, 0.46F, 0.30F, 0.08F, 0.70F, 2.0F, 0.06F},   // kStuccoStain
    {0.20F, 0.13F, 0.07F, 0.14F, 0.95F, 0.6F, 0.06F},   // kPlanks
    {0.05F, 0.06F, 0.07F, 0.03F, 0.50F, 1.5F, 0.02F},   // kGlass
    {0.34F, 0.33F, 0.30F, 0.13F, 1.00F, 0.5F, 0.03F},   // kCurtain
    {0.27F, 0.25F, 0.22F, 0.22F, 1.05F, 1.0F, 0.08F},   // kGround
    {0.36F, 0.35F, 0.33F, 0.11F, 1.00F, 0.8F, 0.05F},   // kPaving
    {0.66F, 0.64F, 0.60F, 0.09F, 1.00F, 0.8F, 0.05F},   // kMarble
    {0.40F, 0.06F, 0.05F, 0.010F, 0.50F, 1.5F, 0.01F},  // kLacquer
};

struct Block {
  int32_t column = 0;
  int32_t row = 0;
  float joint = 0;  // 0 within the block .. 1 in the joint
};

// Courses of blocks, every other one shifted by half a block.
Block BlockAt(const Eigen::Vector2f& uv, float width, float height, float joint_width, float footprint) {
  Block block;
  const float row = std::floor(uv.y() / height);
  const float shifted = uv.x() / width + (std::fmod(row, 2.0F) != 0 ? 0.5F : 0.0F);
  const float column = std::floor(shifted);
  block.column = static_cast<int32_t>(column);
  block.row = static_cast<int32_t>(row);
  const float in_x = (shifted - column) * width;
  const float in_y = uv.y() - row * height;
  const float to_edge = std::min(std::min(in_x, width - in_x), std::min(in_y, height - in_y));
  const float soft = std::max(footprint, 0.3F * joint_width);
  // A joint narrower than a pixel covers only part of it.
  const float strength = std::min(1.0F, joint_width / footprint);
  block.joint = strength * std::clamp((0.5F * joint_width + 0.5F * soft - to_edge) / soft, 0.0F, 1.0F);
  return block;
}

}  // namespace

float Gloss(Material material) { return material == Material::kLacquer ? 0.25F : 0.0F; }

Eigen::Vector3f Reflectance(Material material, const Eigen::Vector3f& x_in_world, const Eigen::Vector2f& uv_in_world,
                            float unit, float footprint_in_world, uint32_t salt) {
  const Recipe& recipe = kRecipes[static_cast<int>(material)];
  const Eigen::Vector3f x = x_in_world / unit;
  const Eigen::Vector2f uv = uv_in_world / unit;
  const float footprint = footprint_in_world / unit;
  salt += 0x1000193U * static_cast<uint32_t>(material);
  const float noise = FractalNoise(x, recipe.largest, recipe.persistence, footprint, salt);
  float tone = 1.0F + recipe.contrast * noise;
  Eigen::Vector3f color(recipe.red, recipe.green, recipe.blue);
  switch (material) {
    case Material::kAshlar: {
      const Block block = BlockAt(uv, 0.74F, 0.37F, 0.022F, footprint);
      tone *= 0.78F + 0.44F * HashCell(block.column, block.row, 1, salt);
      tone *= 1.0F - 0.5F * block.joint;
      break;
    }
    case Material::kBrick: {
      const Block block = BlockAt(uv, 0.25F, 0.083F, 0.014F, footprint);
      tone *= 0.88F + 0.24F * HashCell(block.column, block.row, 2, salt);
      color += 0.8F * block.joint * (Eigen::Vector3f(0.42F, 0.38F, 0.33F) - color);
      break;
    }
    case Material::kPlanks: {
      const float across = uv.x() / 0.14F;
      const float plank = std::floor(across);
      const float to_edge = 0.14F * std::min(across - plank, plank + 1 - across);
      tone *= 0.8F + 0.4F * HashCell(static_cast<int32_t>(plank), 0, 3, salt);
      tone *= to_edge < std::max(0.006F, 0.4F * footprint) ? 0.45F : 1.0F;
      // Grain runs along the plank.
      tone += 0.3F * FractalNoise({40 * uv.x(), 2.0F * uv.y(), plank}, 2.0F, 0.6F, 40 * footprint, salt + 7);
      break;
    }
    case Material::kPaving: {
      const Block block = BlockAt(uv, 0.5F, 0.5F, 0.02F, footprint);
      tone *= 0.9F + 0.2F * HashCell(block.column, block.row, 4, salt);
      tone *= 1.0F - 0.55F * block.joint;
      break;
    }
    case Material::kMarble: {
      const float warp = FractalNoise(x, 0.5F, 0.6F, footprint, salt + 11);
      const float vein = std::abs(ValueNoise(x / 0.23F + Eigen::Vector3f::Constant(1.4F * warp), salt + 12));
      tone *= 1.0F - 0.45F * std::max(0.0F, 1.0F - 5.0F * vein);
      break;
    }
    default:
      break;
  }
  const float hue = recipe.tint * ValueNoise(x / 0.45F, salt + 21);
  color = color.cwiseProduct(Eigen::Vector3f(1 + hue, 1, 1 - hue));
  return (std::max(0.06F, tone) * color).cwiseMin(0.95F);
}

}  // namespace meshwright
