// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "worker/photo_consistency/patch_scorer.h"

namespace meshwright {

// The view as its photograph of half the size has it, halved so many times (0: as it is). Its picture must have that
// many levels more.
ScoredView Halved(const ScoredView& view, int times = 1);

}  // namespace meshwright
