// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <cstdint>

#include <Eigen/Core>

namespace meshwright {

// Finalizer of MurmurHash3 (Appleby 2011) in 64 bits: every bit of the input changes half of the output's.
inline uint64_t HashBits(uint64_t x) {
  x ^= x >> 33U;
  x *= 0xff51afd7ed558ccdULL;
  x ^= x >> 33U;
  x *= 0xc4ceb9fe1a85ec53ULL;
  return x ^ (x >> 33U);
}

inline uint64_t HashBits(uint64_t a, uint64_t b) { return HashBits(a ^ (HashBits(b) + 0x9e3779b97f4a7c15ULL)); }
inline uint64_t HashBits(uint64_t a, uint64_t b, uint64_t c) { return HashBits(HashBits(a, b), c); }

// Uniform in [0, 1).
inline double UniformFromBits(uint64_t bits) { return static_cast<double>(bits >> 11U) * 0x1.0p-53; }

// Mean 0, variance 1, within +-3.47: the sum of four uniform numbers (Irwin-Hall). No libm, so the same everywhere.
inline double NormalFromBits(uint64_t bits) {
  const uint64_t sum = (bits & 0xffffU) + ((bits >> 16U) & 0xffffU) + ((bits >> 32U) & 0xffffU) + (bits >> 48U);
  return (static_cast<double>(sum) - 131070.0) * (1.7320508075688772 / 65536.0);
}

// A stream of random numbers; equal seeds give equal streams on every machine.
class HashRandom {
 public:
  explicit HashRandom(uint64_t seed) : seed_(HashBits(seed)) {}
  uint64_t Bits() { return HashBits(seed_, counter_++); }
  double Uniform(double low, double high) { return low + (high - low) * UniformFromBits(Bits()); }
  double Normal() { return NormalFromBits(Bits()); }
  // Uniform in 0 .. count - 1.
  int Index(int count) { return static_cast<int>(Bits() % static_cast<uint64_t>(count)); }

 private:
  uint64_t seed_;
  uint64_t counter_ = 0;
};

// Value in [0, 1) of an integer position.
inline float HashCell(int32_t x, int32_t y, int32_t z, uint32_t salt) {
  uint32_t h = salt ^ (static_cast<uint32_t>(x) * 0x8da6b343U) ^ (static_cast<uint32_t>(y) * 0xd8163841U) ^
               (static_cast<uint32_t>(z) * 0xcb1ab31fU);
  h ^= h >> 15U;
  h *= 0x2c1b3c6dU;
  h ^= h >> 12U;
  h *= 0x297a2d39U;
  h ^= h >> 15U;
  return static_cast<float>(h >> 8U) * 0x1.0p-24F;
}

// Value noise with cells of size 1: in [-1, 1], mean 0, continuous.
inline float ValueNoise(const Eigen::Vector3f& x, uint32_t salt) {
  const Eigen::Vector3f cell = x.array().floor();
  const auto i = static_cast<int32_t>(cell.x());
  const auto j = static_cast<int32_t>(cell.y());
  const auto k = static_cast<int32_t>(cell.z());
  const Eigen::Array3f t = (x - cell).array();
  const Eigen::Array3f w = t * t * (3.0F - 2.0F * t);
  const auto lerp = [](float a, float b, float s) { return a + s * (b - a); };
  const float near = lerp(lerp(HashCell(i, j, k, salt), HashCell(i + 1, j, k, salt), w.x()),
                          lerp(HashCell(i, j + 1, k, salt), HashCell(i + 1, j + 1, k, salt), w.x()), w.y());
  const float far = lerp(lerp(HashCell(i, j, k + 1, salt), HashCell(i + 1, j, k + 1, salt), w.x()),
                         lerp(HashCell(i, j + 1, k + 1, salt), HashCell(i + 1, j + 1, k + 1, salt), w.x()), w.y());
  return 2.0F * lerp(near, far, w.z()) - 1.0F;
}

// Octaves of value noise from wavelength `largest` down to where they would be finer than the pixel footprint: each
// octave fades out between cells of 1.6 and 0.8 footprints. `persistence`: amplitude of an octave over that of the one
// above.
inline float FractalNoise(const Eigen::Vector3f& x, float largest, float persistence, float footprint, uint32_t salt) {
  float sum = 0;
  float amplitude = 1;
  for (float wavelength = largest; wavelength > 0.8F * footprint && amplitude > 0.02F; wavelength *= 0.5F) {
    const float fade = std::fmin(1.0F, wavelength / (0.8F * footprint) - 1.0F);
    sum += fade * amplitude * ValueNoise(x / wavelength, salt);
    amplitude *= persistence;
    salt += 0x9e3779b9U;
  }
  return sum;
}

}  // namespace meshwright
