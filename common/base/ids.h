// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

namespace meshwright {

// Position of a camera in Scene::views, which importers sort by image name: the same photographs give the same
// indices in whatever order a file lists them.
using CameraIndex = int32_t;

// Number of a reference camera in the order of processing: 1, 2, 3 ... It is also the number of its commit.
// 0 stands for "before the first commit".
using SequenceNumber = int32_t;

}  // namespace meshwright
