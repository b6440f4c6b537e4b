// SPDX-License-Identifier: Apache-2.0
#include "common/surface/codec.h"

#include <cmath>
#include <random>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <zlib.h>

#include "common/base/little_endian.h"
#include "common/surface/random_surface_testing.h"

namespace meshwright {
namespace {

using testing::HasSubstr;

void ExpectSame(const PatchLattice& a, const PatchLattice& b) {
  EXPECT_EQ(a.camera_index, b.camera_index);
  EXPECT_EQ(a.camera.width, b.camera.width);
  EXPECT_EQ(a.camera.height, b.camera.height);
  EXPECT_EQ(a.camera.K(), b.camera.K());
  EXPECT_EQ(a.camera.cam_from_world.rotation, b.camera.cam_from_world.rotation);
  EXPECT_EQ(a.camera.cam_from_world.translation, b.camera.cam_from_world.translation);
  EXPECT_EQ(a.lattice.step, b.lattice.step);
  EXPECT_EQ(a.lattice.columns, b.lattice.columns);
  EXPECT_EQ(a.lattice.rows, b.lattice.rows);
  EXPECT_EQ(a.depth, b.depth);
  EXPECT_EQ(a.normal_in_world, b.normal_in_world);
  EXPECT_EQ(a.quality, b.quality);
  EXPECT_EQ(a.rgb, b.rgb);
  EXPECT_EQ(a.links, b.links);
}

TEST(SurfaceCodec, DecodingGivesWhatWasEncoded) {
  for (const double density : {0.0, 0.01, 0.5, 0.97, 1.0}) {
    for (const auto& [width, height, step] : {std::tuple{1, 1, 1}, {640, 3, 1}, {31, 57, 2}, {80, 60, 3}, {4, 4, 9}}) {
      const PatchLattice surface = RandomSurface(9, SmallCamera(width, height), step, density, 0.8);
      const std::string bytes = EncodeSurface(surface);
      const auto decoded = DecodeSurface(bytes);
      ASSERT_TRUE(decoded.ok()) << decoded.status();
      ExpectSame(surface, *decoded);
      EXPECT_EQ(EncodeSurface(*decoded), bytes);
    }
  }
}

TEST(SurfaceCodec, EmptyLatticeIsASurfaceToo) {
  const auto decoded = DecodeSurface(EncodeSurface(PatchLattice()));
  ASSERT_TRUE(decoded.ok()) << decoded.status();
  ExpectSame(PatchLattice(), *decoded);
}

TEST(SurfaceCodec, WhatNodesWithoutPatchCarryIsNotKept) {
  const PatchLattice surface = RandomSurface(2, SmallCamera(9, 9), 1, 0.5, 0.5);
  PatchLattice littered = surface;
  for (size_t node = 0; node < littered.depth.size(); ++node) {
    if (littered.HasPatch(static_cast<int64_t>(node))) continue;
    littered.quality[node] = 0.7F;
    littered.rgb[node] = {1, 2, 3};
  }
  EXPECT_EQ(EncodeSurface(littered), EncodeSurface(surface));
}

TEST(SurfaceCodec, AtMost24BytesAPatch) {
  const PatchLattice surface = RandomSurface(2, SmallCamera(100, 100), 1, 1, 1);
  EXPECT_LE(EncodeSurface(surface).size(), 24 * 100 * 100 + 256);
}

TEST(SurfaceCodec, EveryTruncationAndEveryFlippedBitIsDataLoss) {
  const std::string bytes = EncodeSurface(RandomSurface(6, SmallCamera(13, 7), 1, 0.7, 0.7));
  for (size_t length = 0; length < bytes.size(); ++length) {
    EXPECT_EQ(DecodeSurface(bytes.substr(0, length)).status().code(), absl::StatusCode::kDataLoss);
  }
  EXPECT_EQ(DecodeSurface(bytes + '\0').status().code(), absl::StatusCode::kDataLoss);
  std::string bad = bytes;
  for (size_t i = 0; i < bytes.size(); ++i) {
    for (int bit = 0; bit < 8; ++bit) {
      bad[i] = static_cast<char>(bytes[i] ^ (1 << bit));
      EXPECT_EQ(DecodeSurface(bad).status().code(), absl::StatusCode::kDataLoss);
    }
    bad[i] = bytes[i];
  }
}

// A bitwise CRC-32, the slow twin of zlib's.
uint32_t SlowCrc32(const std::string& bytes) {
  uint32_t crc = ~0U;
  for (const char c : bytes) {
    crc ^= static_cast<uint8_t>(c);
    for (int k = 0; k < 8; ++k) crc = (crc >> 1) ^ ((crc & 1) != 0 ? 0xEDB88320U : 0);
  }
  return ~crc;
}

std::string WithChecksum(std::string bytes) {
  bytes.resize(bytes.size() - 4);
  const uint32_t crc = SlowCrc32(bytes);
  for (int k = 0; k < 4; ++k) bytes.push_back(static_cast<char>(crc >> (8 * k)));
  return bytes;
}

// Malice, not accident: the checksum fits, the fields lie.
TEST(SurfaceCodec, FieldsAreNotTrustedEvenWhenTheChecksumFits) {
  const std::string bytes = EncodeSurface(RandomSurface(6, SmallCamera(13, 7), 1, 0.7, 0.7));
  EXPECT_EQ(WithChecksum(bytes), bytes);
  std::string bad = bytes;
  for (size_t i = 0; i < bytes.size() - 4; ++i) {
    for (const int flip : {0x01, 0x80, 0xFF}) {
      bad[i] = static_cast<char>(bytes[i] ^ flip);
      const auto decoded = DecodeSurface(WithChecksum(bad));
      if (decoded.ok()) {
        EXPECT_EQ(decoded->depth.size(), static_cast<size_t>(decoded->lattice.nodes()));
      } else {
        EXPECT_EQ(decoded.status().code(), absl::StatusCode::kDataLoss);
      }
    }
    bad[i] = bytes[i];
  }
}

TEST(SurfaceCodec, ErrorsSayWhatIsWrong) {
  const std::string bytes = EncodeSurface(RandomSurface(6, SmallCamera(13, 7), 1, 0.7, 0.7));
  const auto patched = [&](size_t offset, char value) {
    std::string bad = bytes;
    bad[offset] = value;
    return DecodeSurface(WithChecksum(bad)).status().ToString();
  };
  EXPECT_THAT(DecodeSurface("MW").status().ToString(), HasSubstr("length"));
  EXPECT_THAT(patched(0, 'X'), HasSubstr("magic"));
  EXPECT_THAT(patched(4, 9), HasSubstr("version is 9, expected 1"));
  EXPECT_THAT(patched(28, 0), HasSubstr("lattice step is 0"));
  EXPECT_THAT(patched(32, 14), HasSubstr("lattice is 14 x 7, expected 13 x 7"));
  EXPECT_THAT(patched(48, 0), HasSubstr("patches"));
  EXPECT_THAT(patched(192 + 4, 0), HasSubstr("run 0"));
  std::string bad = bytes;
  bad[200] ^= 1;
  EXPECT_THAT(DecodeSurface(bad).status().ToString(), HasSubstr("checksum"));
}

TEST(SurfaceCodec, NoiseIsDataLoss) {
  std::mt19937 random(1);
  for (int i = 0; i < 100; ++i) {
    std::string noise(i * 13, '\0');
    for (char& c : noise) c = static_cast<char>(random());
    EXPECT_EQ(DecodeSurface(noise).status().code(), absl::StatusCode::kDataLoss);
  }
}

// `bytes` with `value` at `offset` and the checksum that belongs to it: what a malicious writer makes.
template <typename T>
std::string Forged(std::string bytes, size_t offset, T value) {
  StoreLittleEndian(value, bytes.data() + offset);
  const size_t covered = bytes.size() - 4;
  const uLong crc = ::crc32(0, reinterpret_cast<const Bytef*>(bytes.data()), static_cast<uInt>(covered));
  StoreLittleEndian(static_cast<uint32_t>(crc), bytes.data() + covered);
  return bytes;
}

TEST(SurfaceCodec, NumbersThatNoCameraHasAreDataLoss) {
  const std::string bytes = EncodeSurface(RandomSurface(6, SmallCamera(13, 7), 1, 1, 1));
  constexpr size_t kCameraNumbers = 56;
  ASSERT_TRUE(DecodeSurface(Forged(bytes, kCameraNumbers, LoadLittleEndian<double>(&bytes[kCameraNumbers]))).ok());
  for (size_t number = 0; number < 16; ++number) {
    for (const double value : {1e300, -1e300, std::nan("")}) {
      const absl::Status status = DecodeSurface(Forged(bytes, kCameraNumbers + 8 * number, value)).status();
      EXPECT_EQ(status.code(), absl::StatusCode::kDataLoss) << number << ": " << value;
    }
  }
  for (const size_t focal : {0, 1}) EXPECT_FALSE(DecodeSurface(Forged(bytes, kCameraNumbers + 8 * focal, 0.0)).ok());
  constexpr size_t kDepths = 192 + 8;  // behind the header and the one run
  for (const float depth : {0.0F, 1e30F, -1.0F, std::nanf("")}) {
    EXPECT_FALSE(DecodeSurface(Forged(bytes, kDepths, depth)).ok()) << depth;
  }
  constexpr size_t kNormals = kDepths + size_t{4} * 13 * 7;
  for (const float coordinate : {2.0F, std::nanf("")}) {
    EXPECT_FALSE(DecodeSurface(Forged(bytes, kNormals, coordinate)).ok()) << coordinate;
  }
}

}  // namespace
}  // namespace meshwright
