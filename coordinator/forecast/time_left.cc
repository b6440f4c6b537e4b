// SPDX-License-Identifier: Apache-2.0
#include "coordinator/forecast/time_left.h"

#include <algorithm>

namespace meshwright {
namespace {

// What a job counts against the one after it: half as much after some twelve.
constexpr double kDecay = 0.944;
// An expected share of nothing at all has no seconds to a ray.
constexpr double kFewestRays = 1;

}  // namespace

void JobRate::Add(const JobTimes& times, double expected_rays) {
  for (double* const sum : {&weight_, &preparing_seconds_, &growing_seconds_, &expected_rays_}) *sum *= kDecay;
  weight_ += 1;
  preparing_seconds_ += times.preparing_seconds;
  growing_seconds_ += times.growing_seconds;
  expected_rays_ += expected_rays;
}

double JobRate::SecondsOf(const CameraWork& work) const {
  if (!is_known()) return 0;
  return preparing_seconds_ / weight_ * static_cast<double>(work.cameras) +
         growing_seconds_ / std::max(expected_rays_, kFewestRays) * work.expected_rays;
}

double CameraSecondsLeft(const JobRate& rate, const CameraWork& left, double done_seconds, int64_t done_cameras,
                         double elapsed_seconds) {
  if (left.cameras == 0) return 0;
  if (!rate.is_known() || done_cameras == 0 || !(done_seconds > 0) || !(elapsed_seconds > 0)) return -1;
  // The jobs beside the one that has just ended are half done, one with the other.
  const double one = done_seconds / static_cast<double>(done_cameras);
  const double at_once = std::max(1.0, done_seconds / elapsed_seconds);
  const double left_seconds = rate.SecondsOf(left);
  const double begun = std::min(0.5 * (at_once - 1) * one, 0.5 * left_seconds);
  return (left_seconds - begun) * elapsed_seconds / (done_seconds + begun);
}

}  // namespace meshwright
