// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "common/base/ids.h"

namespace meshwright {

// One accepted surface M_r in the BlobStore.
struct AcceptedSurface {
  SequenceNumber sequence = 0;
  CameraIndex camera = 0;
  std::string digest;
  int64_t patches = 0;
};

// What a worker needs to know to process one reference camera.
struct CameraJobSpec {
  SequenceNumber sequence = 0;
  CameraIndex camera = 0;
  SequenceNumber snapshot = 0;
  int64_t epoch = 1;                      // to be named with the result
  int reduction = 0;                      // how many times the job was made smaller after it ran out of memory
  std::vector<CameraIndex> neighbours;    // O_r as of the snapshot, ascending
  std::vector<CameraIndex> targets;       // the chosen part of it, best first
  std::vector<AcceptedSurface> accepted;  // what may hide something from r: accepted in commits <= snapshot by cameras
                                          // that overlap r; by camera. V_r is made of these
};

}  // namespace meshwright
