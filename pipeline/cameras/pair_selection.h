#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "pipeline/cameras/photograph_folder.h"

namespace meshwright {

// Which photographs are compared with which.
enum class PairSelection {
  kExhaustive,      // each with each
  kSequential,      // each with those that follow, and with those that look alike
  kVocabularyTree,  // each with those that look most alike, by a vocabulary of the photographs' own features
};
std::string NameOf(PairSelection selection);
std::optional<PairSelection> PairSelectionOfName(std::string_view name);

struct ChosenPairs {
  PairSelection selection = PairSelection::kExhaustive;
  std::string reason;  // for people
};

// Each with each up to 200 photographs; more of them: sequential when they are frames of a video (one prefix, numbers
// that follow each other, no camera in EXIF), else by vocabulary.
ChosenPairs ChoosePairs(const std::vector<Photograph>& photographs);

}  // namespace meshwright
// SPDX-License-Identifier: Apache-2.0
