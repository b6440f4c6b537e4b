// SPDX-License-Identifier: Apache-2.0
#include "pipeline/cameras/nearest_descriptors.h"

#include <algorithm>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "pipeline/cameras/nearest_descriptors.cc"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace meshwright {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using I32 = hn::CappedTag<int32_t, PackedDescriptors::kBlock>;
using I16 = hn::Repartition<int16_t, I32>;
using V = hn::VFromD<I32>;
constexpr size_t kLanes = hn::MaxLanes(I32());
constexpr size_t kParts = PackedDescriptors::kBlock / kLanes;
constexpr size_t kRows = kParts == 1 ? 8 : 4;  // compared at once: what registers hold

// sum + the products of both pairs of numbers in each lane.
HWY_INLINE V AddProducts(V sum, V x, V y) {
#if HWY_ARCH_X86 && HWY_TARGET != HWY_SCALAR
  V unused = hn::Zero(I32());
  return hn::ReorderWidenMulAccumulate(I32(), hn::BitCast(I16(), x), hn::BitCast(I16(), y), sum, unused);
#else
  const V low = hn::Mul(hn::ShiftRight<16>(hn::ShiftLeft<16>(x)), hn::ShiftRight<16>(hn::ShiftLeft<16>(y)));
  return hn::Add(sum, hn::Add(low, hn::Mul(hn::ShiftRight<16>(x), hn::ShiftRight<16>(y))));
#endif
}

// The best two so far of each lane.
struct Best {
  V best;
  V second;
  V index;

  HWY_INLINE void Update(V product, V number) {
    index = hn::IfThenElse(hn::Gt(product, best), number, index);
    second = hn::Max(second, hn::Min(product, best));
    best = hn::Max(best, product);
  }
};

void Reduce(const Best& lanes, size_t at, NearestDescriptors& out) {
  HWY_ALIGN int32_t best[kLanes];
  HWY_ALIGN int32_t second[kLanes];
  HWY_ALIGN int32_t index[kLanes];
  hn::Store(lanes.best, I32(), best);
  hn::Store(lanes.second, I32(), second);
  hn::Store(lanes.index, I32(), index);
  for (size_t i = 0; i < kLanes; ++i) {
    const bool better = best[i] > out.best[at] || (best[i] == out.best[at] && index[i] < out.index[at]);
    out.second[at] = std::max({out.second[at], second[i], std::min(best[i], out.best[at])});
    if (better) out.index[at] = index[i];
    out.best[at] = std::max(out.best[at], best[i]);
  }
}

void FindNearestImplementation(const PackedDescriptors& a, const PackedDescriptors& b, NearestDescriptors& of_a,
                               NearestDescriptors& of_b) {
  const I32 i32;
  HWY_ALIGN int32_t lane_numbers[kLanes];
  for (size_t i = 0; i < kLanes; ++i) lane_numbers[i] = static_cast<int32_t>(i);
  const V lanes = hn::Load(i32, lane_numbers);
  for (size_t row = 0; row < a.count(); row += kRows) {
    const int32_t* const rows = a.Block(row / PackedDescriptors::kBlock) + row % PackedDescriptors::kBlock;
    Best best_of_row[kRows];
    for (Best& best : best_of_row) best = {hn::Set(i32, -1), hn::Zero(i32), hn::Set(i32, -1)};
    for (size_t block = 0; block < b.blocks(); ++block) {
      const int32_t* const columns = b.Block(block);
      V products[kRows][kParts];
      for (auto& of_row : products) {
        for (V& product : of_row) product = hn::Zero(i32);
      }
      for (size_t k = 0; k < PackedDescriptors::kSteps * PackedDescriptors::kBlock; k += PackedDescriptors::kBlock) {
        V column[kParts];
        for (size_t p = 0; p < kParts; ++p) column[p] = hn::LoadU(i32, columns + k + p * kLanes);
        for (size_t r = 0; r < kRows; ++r) {
          const V repeated = hn::Set(i32, rows[k + r]);
          for (size_t p = 0; p < kParts; ++p) products[r][p] = AddProducts(products[r][p], repeated, column[p]);
        }
      }
      for (size_t p = 0; p < kParts; ++p) {
        const size_t at = block * PackedDescriptors::kBlock + p * kLanes;
        const V numbers = hn::Add(lanes, hn::Set(i32, static_cast<int32_t>(at)));
        Best best_of_column = {hn::LoadU(i32, &of_b.best[at]), hn::LoadU(i32, &of_b.second[at]),
                               hn::LoadU(i32, &of_b.index[at])};
        for (size_t r = 0; r < kRows; ++r) {
          best_of_row[r].Update(products[r][p], numbers);
          best_of_column.Update(products[r][p], hn::Set(i32, static_cast<int32_t>(row + r)));
        }
        hn::StoreU(best_of_column.best, i32, &of_b.best[at]);
        hn::StoreU(best_of_column.second, i32, &of_b.second[at]);
        hn::StoreU(best_of_column.index, i32, &of_b.index[at]);
      }
    }
    for (size_t r = 0; r < kRows; ++r) Reduce(best_of_row[r], row + r, of_a);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace meshwright
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace meshwright {

HWY_EXPORT(FindNearestImplementation);

PackedDescriptors::PackedDescriptors(std::span<const uint8_t> bytes) : count_(bytes.size() / kDescriptorBytes) {
  pairs_.assign(blocks() * kSteps * kBlock, 0);
  for (size_t i = 0; i < count_; ++i) {
    for (size_t k = 0; k < kSteps; ++k) {
      const uint8_t* const two = &bytes[i * kDescriptorBytes + 2 * k];
      pairs_[((i / kBlock) * kSteps + k) * kBlock + i % kBlock] = two[0] | two[1] << 16;
    }
  }
}

void FindNearest(const PackedDescriptors& a, const PackedDescriptors& b, NearestDescriptors* of_a,
                 NearestDescriptors* of_b) {
  const auto resize = [](NearestDescriptors* table, size_t count) {
    table->index.resize(count, -1);
    table->best.resize(count, -1);
    table->second.resize(count, 0);
  };
  *of_a = {};
  *of_b = {};
  resize(of_a, a.blocks() * PackedDescriptors::kBlock);
  resize(of_b, b.blocks() * PackedDescriptors::kBlock);
  // What fills the last blocks is 0, comes after the others, and so is never better than these.
  HWY_DYNAMIC_DISPATCH(FindNearestImplementation)(a, b, *of_a, *of_b);
  resize(of_a, a.count());
  resize(of_b, b.count());
}

}  // namespace meshwright
#endif
