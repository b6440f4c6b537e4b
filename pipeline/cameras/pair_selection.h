// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "pipeline/cameras/colmap_database.h"
#include "pipeline/cameras/photograph_folder.h"

namespace meshwright {

// Which photographs are compared with which.
enum class PairSelection {
  kExhaustive,  // each with each
  kSequential,  // each with those that follow, and with those that look alike
  kSimilar,     // each with those that share most of its largest features
};
std::string NameOf(PairSelection selection);
std::optional<PairSelection> PairSelectionOfName(std::string_view name);

struct ChosenPairs {
  PairSelection selection = PairSelection::kExhaustive;
  std::string reason;  // for people
};

// Each with each up to 200 photographs; more of them: sequential when they are frames of a video (one prefix, numbers
// that follow each other, no camera in EXIF), else by what they share.
ChosenPairs ChoosePairs(const std::vector<Photograph>& photographs);

// Pairs that follow from the numbers alone, 1 .. `images`, ascending: all of them, those of each with the 10 that
// follow, or none.
std::vector<ImagePair> PairsByNumber(PairSelection selection, int64_t images);
// With how many that look alike each is to be compared besides; 0: none.
size_t SimilarPerPhotograph(PairSelection selection);

}  // namespace meshwright
