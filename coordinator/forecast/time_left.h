// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "coordinator/forecast/job_times.h"

namespace meshwright {

// Some cameras' work, before it is done.
struct CameraWork {
  int64_t cameras = 0;
  double expected_rays = 0;  // SurfaceToGrow's share of their rays

  void Add(double rays) {
    ++cameras;
    expected_rays += rays;
  }
};

// What jobs take: so much for each camera, and so much for each ray that was expected to be grown. Measured on the last
// jobs that were done, since surface fills and the share of rays that see nothing grows.
class JobRate {
 public:
  void Add(const JobTimes& times, double expected_rays);
  bool is_known() const { return weight_ > 0; }
  // Seconds of jobs, whatever runs at the same time.
  double SecondsOf(const CameraWork& work) const;

 private:
  double weight_ = 0;
  double preparing_seconds_ = 0;
  double growing_seconds_ = 0;
  double expected_rays_ = 0;
};

// Seconds until all cameras are done, by how many seconds of jobs have gone by in each second so far: `done_seconds` of
// those that were done within `elapsed_seconds`, while others began that are still running and belong to `left`.
// Nothing can be said (-1) before the first is done.
double CameraSecondsLeft(const JobRate& rate, const CameraWork& left, double done_seconds, int64_t done_cameras,
                         double elapsed_seconds);

}  // namespace meshwright
