// SPDX-License-Identifier: Apache-2.0
#include "tools/synthetic/photographs.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "tools/synthetic/hash_noise.h"

namespace meshwright {
namespace {

struct SurfaceSample {
  Eigen::Vector3f x;
  Eigen::Vector3f normal;  // for shading, towards the camera
  Eigen::Vector3f reflectance;
  float gloss = 0;
};

SurfaceSample Sample(const World& world, const RayHit& hit, const Eigen::Vector3d& x, float footprint, uint32_t salt) {
  const std::array<uint32_t, 3>& face = world.mesh.faces[static_cast<size_t>(hit.face)];
  const float w = 1 - hit.u - hit.v;
  SurfaceSample sample;
  sample.x = x.cast<float>();
  sample.normal =
      (w * world.mesh.normals[face[0]] + hit.u * world.mesh.normals[face[1]] + hit.v * world.mesh.normals[face[2]])
          .normalized();
  const Eigen::Vector2f uv = w * world.uv[face[0]] + hit.u * world.uv[face[1]] + hit.v * world.uv[face[2]];
  sample.reflectance =
      Reflectance(world.material[static_cast<size_t>(hit.face)], sample.x, uv, world.unit, footprint, salt);
  sample.gloss = Gloss(world.material[static_cast<size_t>(hit.face)]);
  return sample;
}

Eigen::Vector3f Sky(const World& world, const Eigen::Vector3d& direction) {
  const auto up = static_cast<float>(std::clamp(2.0 * direction.normalized().z(), 0.0, 1.0));
  return (1 - up) * world.sky_low + up * world.sky_high;
}

// Light of the lamps that a sample sends to the camera, linear: diffuse, and a highlight (Blinn and Phong).
Eigen::Vector3f LampLight(const World& world, const SurfaceSample& sample, const Eigen::Vector3f& to_camera) {
  Eigen::Vector3f sum = Eigen::Vector3f::Zero();
  for (const Lamp& lamp : world.lamps) {
    const Eigen::Vector3f offset = lamp.position - sample.x;
    const float cosine = sample.normal.dot(offset.normalized());
    if (cosine <= 0) continue;
    const float irradiance = lamp.power * world.unit * world.unit / offset.squaredNorm();
    sum += irradiance * cosine * sample.reflectance;
    if (sample.gloss <= 0) continue;
    float highlight = std::max(0.0F, sample.normal.dot((offset.normalized() + to_camera).normalized()));
    for (int i = 0; i < 6; ++i) highlight *= highlight;  // to the 64th
    sum += Eigen::Vector3f::Constant(4 * sample.gloss * irradiance * highlight);
  }
  return sum;
}

// Radiance of a pixel in linear RGB: the mean of four samples, one in each quarter.
Eigen::Vector3f PixelRadiance(const World& world, const MeshRayCaster& caster, const Camera& camera,
                              const Eigen::Vector3d& center, const Eigen::Matrix3d& world_from_cam, int column, int row,
                              uint64_t pixel_seed, uint32_t salt) {
  std::array<Eigen::Vector3d, 4> directions;
  for (size_t i = 0; i < 4; ++i) {
    const uint64_t bits = HashBits(pixel_seed, i);
    const bool right = i % 2 == 1;
    const bool lower = i >= 2;
    const double dx = 0.5 * ((right ? 1.0 : 0.0) + static_cast<double>(bits & 0xffffU) / 65536.0);
    const double dy = 0.5 * ((lower ? 1.0 : 0.0) + static_cast<double>((bits >> 16U) & 0xffffU) / 65536.0);
    directions[i] = world_from_cam * camera.RayInCam(column + dx, row + dy);
  }
  const std::array<RayHit, 4> hits = caster.Cast4(center, directions);
  std::array<SurfaceSample, 4> samples;
  std::array<Eigen::Vector3d, 4> lifted;
  uint32_t lit = 0;
  for (uint32_t i = 0; i < 4; ++i) {
    lifted[i] = center;
    if (!hits[i].ok()) continue;
    const Eigen::Vector3d x = center + hits[i].distance * directions[i];
    const auto footprint = static_cast<float>(hits[i].distance / camera.focal());
    samples[i] = Sample(world, hits[i], x, footprint, salt);
    // Shadow rays start a little off the surface.
    lifted[i] = x + 2e-4 * world.unit * samples[i].normal.cast<double>();
    if (samples[i].normal.dot(world.to_sun) > 0) lit |= 1U << i;
  }
  const Eigen::Vector3d to_sun = world.to_sun.cast<double>();
  if (lit != 0) lit &= ~caster.AreBlocked4(lifted, to_sun, 1e-3 * world.unit, lit);
  Eigen::Vector3f sum = Eigen::Vector3f::Zero();
  const Eigen::Vector3f sun_color(1.0F, 0.95F, 0.86F);
  const Eigen::Vector3f sky_color(0.88F, 0.95F, 1.06F);
  for (uint32_t i = 0; i < 4; ++i) {
    if (!hits[i].ok()) {
      sum += Sky(world, directions[i]);
      continue;
    }
    const float sun = (lit >> i & 1U) != 0 ? world.sun * samples[i].normal.dot(world.to_sun) : 0.0F;
    const float sky = world.ambient * (0.62F + 0.38F * samples[i].normal.z());
    sum += samples[i].reflectance.cwiseProduct(sun * sun_color + sky * sky_color);
    if (!world.lamps.empty()) {
      sum += LampLight(world, samples[i], -directions[i].normalized().cast<float>());
    }
  }
  return 0.25F * sum;
}

}  // namespace

std::vector<ColorImage> TakePhotographs(const World& world, const MeshRayCaster& caster,
                                        const std::vector<Camera>& cameras, const SyntheticOptions& options,
                                        ThreadPool& pool) {
  std::vector<ColorImage> images(cameras.size());
  const auto salt = static_cast<uint32_t>(HashBits(options.seed, 201));
  for (size_t c = 0; c < cameras.size(); ++c) {
    const Camera& camera = cameras[c];
    ColorImage& image = images[c];
    image.width = camera.width;
    image.height = camera.height;
    image.rgb.resize(3 * static_cast<size_t>(camera.width) * static_cast<size_t>(camera.height));
    const Eigen::Vector3d center = camera.center_in_world();
    const Eigen::Matrix3d world_from_cam = camera.cam_from_world.rotation.transpose();
    const uint64_t camera_seed = HashBits(options.seed, 202, c);
    const double ev = options.exposure_ev * (2 * UniformFromBits(HashBits(options.seed, 203, c)) - 1);
    const auto exposure = static_cast<float>(std::exp2(ev));
    pool.ParallelFor(camera.height, 4, [&](int64_t begin, int64_t end) {
      for (int row = static_cast<int>(begin); row < static_cast<int>(end); ++row) {
        for (int column = 0; column < camera.width; ++column) {
          const size_t pixel =
              static_cast<size_t>(row) * static_cast<size_t>(camera.width) + static_cast<size_t>(column);
          const uint64_t pixel_seed = HashBits(camera_seed, pixel);
          const Eigen::Vector3f radiance =
              exposure * PixelRadiance(world, caster, camera, center, world_from_cam, column, row, pixel_seed, salt);
          for (size_t channel = 0; channel < 3; ++channel) {
            const double level = 255.0 * std::sqrt(std::max(0.0F, radiance[static_cast<Eigen::Index>(channel)]));
            const double noise = options.noise_sigma * NormalFromBits(HashBits(pixel_seed, 10 + channel));
            image.rgb[3 * pixel + channel] = static_cast<uint8_t>(std::clamp(level + noise + 0.5, 0.0, 255.0));
          }
        }
      }
    });
  }
  return images;
}

}  // namespace meshwright
