// SPDX-License-Identifier: Apache-2.0
#include "worker/photo_consistency/halved_view.h"

#include <utility>

#include "common/base/check.h"

namespace meshwright {

ScoredView Halved(const ScoredView& view, int times) {
  if (times == 0) return view;
  MW_CHECK(times > 0 && times < view.grey->level_count());
  const SamplingImage::Level& level = view.grey->level(times);
  GreyImage grey{level.width, level.height, {}};
  grey.grey.reserve(level.quads.size());
  for (const uint32_t quad : level.quads) grey.grey.push_back(static_cast<uint8_t>(quad & 0xFFU));
  ScoredView halved = view;
  halved.camera.width = level.width;
  halved.camera.height = level.height;
  IgnoredPixels ignored = view.grey->ignored();
  for (int i = 0; i < times; ++i) {
    for (double* const length : {&halved.camera.fx, &halved.camera.fy, &halved.camera.cx, &halved.camera.cy}) {
      *length /= 2;
    }
    ignored = ignored.Halved();
  }
  halved.grey = std::make_shared<SamplingImage>(grey, view.grey->level_count() - times, std::move(ignored));
  return halved;
}

}  // namespace meshwright
