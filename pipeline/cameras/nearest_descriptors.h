// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace meshwright {

constexpr size_t kDescriptorBytes = 128;  // SIFT

// SIFT descriptors in the order in which they are compared: 16 of them side by side, two bytes of each after two bytes
// of the one before, as 16-bit numbers.
class PackedDescriptors {
 public:
  static constexpr size_t kBlock = 16;                    // descriptors
  static constexpr size_t kSteps = kDescriptorBytes / 2;  // of two bytes
  PackedDescriptors() = default;
  // `bytes`: kDescriptorBytes for each.
  explicit PackedDescriptors(std::span<const uint8_t> bytes);

  size_t count() const { return count_; }
  size_t blocks() const { return (count_ + kBlock - 1) / kBlock; }
  // kSteps times kBlock pairs of numbers; descriptors after the last are 0.
  const int32_t* Block(size_t number) const { return &pairs_[number * kSteps * kBlock]; }

 private:
  size_t count_ = 0;
  std::vector<int32_t> pairs_;
};

// For each descriptor of one set: which of the other set is most like it, their scalar product, and the second largest.
struct NearestDescriptors {
  std::vector<int32_t> index;  // of several that are alike the one with the smallest number; -1: none
  std::vector<int32_t> best;
  std::vector<int32_t> second;  // 0 where there is only one
};

// Compares each of `a` with each of `b`, exactly: scalar products of bytes are whole numbers, whatever the processor.
void FindNearest(const PackedDescriptors& a, const PackedDescriptors& b, NearestDescriptors* of_a,
                 NearestDescriptors* of_b);

}  // namespace meshwright
