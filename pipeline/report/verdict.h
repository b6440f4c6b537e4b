// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "coordinator/conductor/final_surfaces.h"

namespace meshwright {

// How far cameras may seem to be off before it is worth a word, px. What is measured is less than what they are off:
// depth takes up a part of it, and patches that do not agree at all are not there to be measured.
inline constexpr double kCamerasOffPx = 0.2;

// What a run came to. Adds to each processed camera of `cameras` (the "cameras" of MakeCamerasReport) what has become
// of its rays ("fate", shares of them), and how far its picture and those of its targets lie apart across epipolar
// lines ("off_px", null where too little was measured). Gives
// {"coverage", "inferred", "blind", "inconsistent", "unsupported", "contradicted", "least_covered", "cameras_off_px"},
// the shares over the rays of all processed cameras: coverage: shows surface that was there before or that this camera
// found and others confirm; inferred: of that, what only smaller photographs or the planes around textureless holes
// say; blind: nothing there looked alike in other photographs; inconsistent: what grew there did not hold together;
// unsupported: no other camera found the same; contradicted: as many look through it.
nlohmann::ordered_json MakeVerdict(const std::vector<JudgedCamera>& judged, nlohmann::ordered_json& cameras);

// A line for people: where the rays went, and, if the verdict has it, by how much cameras were refined ("refined_px").
std::string DescribeVerdict(const nlohmann::ordered_json& verdict);
// Another one when cameras seem to be off; "" otherwise.
std::string DescribeWarning(const nlohmann::ordered_json& verdict);

}  // namespace meshwright
