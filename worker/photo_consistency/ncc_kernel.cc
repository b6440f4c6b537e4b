// SPDX-License-Identifier: Apache-2.0
#include "worker/photo_consistency/ncc_kernel.h"

#include <cmath>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "worker/photo_consistency/ncc_kernel.cc"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace meshwright {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

float NccImplementation(const NccInput& input) {
  const hn::CappedTag<float, kNccGroup> f32;
  const hn::RebindToSigned<decltype(f32)> i32;
  constexpr size_t kLanes = hn::MaxLanes(f32);
  constexpr size_t kParts = kNccGroup / kLanes;
  using F = hn::VFromD<decltype(f32)>;

  const F c0 = hn::Set(f32, input.c[0]);
  const F c1 = hn::Set(f32, input.c[1]);
  const F c2 = hn::Set(f32, input.c[2]);
  const F a0 = hn::Set(f32, input.col0[0]);
  const F a1 = hn::Set(f32, input.col0[1]);
  const F a2 = hn::Set(f32, input.col0[2]);
  const F b0 = hn::Set(f32, input.col1[0]);
  const F b1 = hn::Set(f32, input.col1[1]);
  const F b2 = hn::Set(f32, input.col1[2]);
  const F one = hn::Set(f32, 1.0F);
  const auto stride = hn::Set(i32, input.stride);
  const auto low_byte = hn::Set(i32, 0xFF);

  // Lane i of part p adds up samples p * kLanes + i of every group.
  HWY_ALIGN float sum[kNccGroup];
  HWY_ALIGN float sum_of_squares[kNccGroup];
  HWY_ALIGN float correlation[kNccGroup];
  for (size_t part = 0; part < kParts; ++part) {
    F sum_t = hn::Zero(f32);
    F sum_tt = hn::Zero(f32);
    F sum_rt = hn::Zero(f32);
    for (size_t k = part * kLanes; k < static_cast<size_t>(input.count); k += kNccGroup) {
      const F dx = hn::LoadU(f32, input.dx + k);
      const F dy = hn::LoadU(f32, input.dy + k);
      const F inverse = hn::Div(one, hn::Add(c2, hn::Add(hn::Mul(a2, dx), hn::Mul(b2, dy))));
      const F x = hn::Mul(hn::Add(c0, hn::Add(hn::Mul(a0, dx), hn::Mul(b0, dy))), inverse);
      const F y = hn::Mul(hn::Add(c1, hn::Add(hn::Mul(a1, dx), hn::Mul(b1, dy))), inverse);
      const auto column = hn::ConvertTo(i32, x);  // towards zero = floor, as x >= 0
      const auto row = hn::ConvertTo(i32, y);
      const F fraction_x = hn::Sub(x, hn::ConvertTo(f32, column));
      const F fraction_y = hn::Sub(y, hn::ConvertTo(f32, row));
      const auto quad =
          hn::GatherIndex(i32, reinterpret_cast<const int32_t*>(input.quads), hn::Add(hn::Mul(row, stride), column));
      const F top_left = hn::ConvertTo(f32, hn::And(quad, low_byte));
      const F top_right = hn::ConvertTo(f32, hn::And(hn::ShiftRight<8>(quad), low_byte));
      const F bottom_left = hn::ConvertTo(f32, hn::And(hn::ShiftRight<16>(quad), low_byte));
      const F bottom_right = hn::ConvertTo(f32, hn::And(hn::ShiftRight<24>(quad), low_byte));
      const F top = hn::Add(top_left, hn::Mul(fraction_x, hn::Sub(top_right, top_left)));
      const F bottom = hn::Add(bottom_left, hn::Mul(fraction_x, hn::Sub(bottom_right, bottom_left)));
      const F t = hn::Add(top, hn::Mul(fraction_y, hn::Sub(bottom, top)));
      const F weighted = hn::Mul(hn::LoadU(f32, input.weights + k), t);
      sum_t = hn::Add(sum_t, weighted);
      sum_tt = hn::Add(sum_tt, hn::Mul(weighted, t));
      sum_rt = hn::Add(sum_rt, hn::Mul(hn::LoadU(f32, input.values + k), t));
    }
    hn::Store(sum_t, f32, sum + part * kLanes);
    hn::Store(sum_tt, f32, sum_of_squares + part * kLanes);
    hn::Store(sum_rt, f32, correlation + part * kLanes);
  }
  float mean = 0;
  float mean_square = 0;
  float numerator = 0;
  for (int lane = 0; lane < kNccGroup; ++lane) {
    mean += sum[lane];
    mean_square += sum_of_squares[lane];
    numerator += correlation[lane];
  }
  // A quarter of a grey level squared: below it the target shows its rounding, not texture.
  constexpr float kMinVariance = 0.25F;
  const float variance = mean_square - mean * mean;
  return variance < kMinVariance ? 0.0F : numerator / std::sqrt(variance);
}

}  // namespace HWY_NAMESPACE
}  // namespace meshwright
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace meshwright {

HWY_EXPORT(NccImplementation);

float Ncc(const NccInput& input) { return HWY_DYNAMIC_DISPATCH(NccImplementation)(input); }

}  // namespace meshwright
#endif
