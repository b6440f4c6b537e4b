// SPDX-License-Identifier: Apache-2.0
#include <benchmark/benchmark.h>

#include "common/image/decode.h"
#include "common/image/encode.h"
#include "common/image/remap.h"
#include "common/image/resize.h"
#include "common/image/sampling_image.h"

// What happens to a photograph before it is compared. Rates are in pixels of the photograph.
namespace meshwright {
namespace {

constexpr int kWidth = 1536;
constexpr int kHeight = 1024;

ColorImage Photograph() {
  ColorImage image{kWidth, kHeight, {}};
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      for (int channel = 0; channel < 3; ++channel) {
        image.rgb.push_back(static_cast<uint8_t>((x / 3 * 37 + y / 5 * 91 + (x * y >> 7) + 40 * channel) & 0xFF));
      }
    }
  }
  return image;
}

void CountPixels(benchmark::State& state) { state.SetItemsProcessed(int64_t{kWidth} * kHeight * state.iterations()); }

void BM_DecodeJpeg(benchmark::State& state) {
  const std::string bytes = EncodeJpeg(Photograph(), 92);
  for (auto _ : state) benchmark::DoNotOptimize(DecodeImageBytes(bytes, "photograph"));
  CountPixels(state);
}
BENCHMARK(BM_DecodeJpeg)->Unit(benchmark::kMillisecond);

void BM_ReduceByArea(benchmark::State& state) {
  const ColorImage image = Photograph();
  for (auto _ : state) benchmark::DoNotOptimize(ReduceByArea(image, kWidth * 2 / 3, kHeight * 2 / 3));
  CountPixels(state);
}
BENCHMARK(BM_ReduceByArea)->Unit(benchmark::kMillisecond);

void BM_Remap(benchmark::State& state) {
  const ColorImage image = Photograph();
  const auto shifted = [](int row, std::vector<SourcePosition>* sources) {
    for (size_t x = 0; x < sources->size(); ++x) (*sources)[x] = {static_cast<double>(x) + 0.8, row + 0.2};
  };
  for (auto _ : state) benchmark::DoNotOptimize(Remap(image, kWidth, kHeight, shifted));
  CountPixels(state);
}
BENCHMARK(BM_Remap)->Unit(benchmark::kMillisecond);

void BM_MakeSamplingImage(benchmark::State& state) {
  const GreyImage grey = ToGrey(Photograph());
  for (auto _ : state) benchmark::DoNotOptimize(SamplingImage(grey, 3));
  CountPixels(state);
}
BENCHMARK(BM_MakeSamplingImage)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace meshwright
