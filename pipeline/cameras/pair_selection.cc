// SPDX-License-Identifier: Apache-2.0
#include "pipeline/cameras/pair_selection.h"

#include <algorithm>
#include <cctype>
#include <cstdint>
#include <filesystem>

#include <absl/strings/numbers.h>
#include <absl/strings/str_cat.h>

namespace meshwright {
namespace {

constexpr size_t kMostForEachWithEach = 200;
// Videos are taken apart with a stride, and people delete blurred frames.
constexpr int64_t kLargestGapPerFrame = 60;

constexpr int64_t kFollowing = 10;
constexpr size_t kSimilarFrames = 20;  // of a video, for places that it comes back to
constexpr size_t kSimilarPhotographs = 50;

constexpr struct {
  PairSelection selection;
  const char* name;
} kNames[] = {{PairSelection::kExhaustive, "exhaustive"},
              {PairSelection::kSequential, "sequential"},
              {PairSelection::kSimilar, "similar"}};

struct NumberedName {
  std::string prefix;
  int64_t number = -1;  // -1: none at its end
};

NumberedName SplitName(const std::string& name) {
  const std::string stem = std::filesystem::path(name).replace_extension().string();
  size_t begin = stem.size();
  while (begin > 0 && std::isdigit(static_cast<unsigned char>(stem[begin - 1])) != 0) --begin;
  NumberedName split{.prefix = stem.substr(0, begin)};
  if (!absl::SimpleAtoi(stem.substr(begin), &split.number)) split.number = -1;
  return split;
}

bool AreVideoFrames(const std::vector<Photograph>& photographs) {
  const NumberedName first = SplitName(photographs.front().name);
  const bool alike = std::all_of(photographs.begin(), photographs.end(), [&](const Photograph& photograph) {
    const NumberedName name = SplitName(photograph.name);
    return name.number >= 0 && name.prefix == first.prefix && photograph.exif == ExifCamera() &&
           photograph.size.width == photographs.front().size.width &&
           photograph.size.height == photographs.front().size.height;
  });
  if (!alike) return false;
  const int64_t span = SplitName(photographs.back().name).number - first.number;
  return span < kLargestGapPerFrame * static_cast<int64_t>(photographs.size());
}

}  // namespace

std::string NameOf(PairSelection selection) {
  for (const auto& entry : kNames) {
    if (entry.selection == selection) return entry.name;
  }
  return "";
}

std::optional<PairSelection> PairSelectionOfName(std::string_view name) {
  for (const auto& entry : kNames) {
    if (name == entry.name) return entry.selection;
  }
  return std::nullopt;
}

ChosenPairs ChoosePairs(const std::vector<Photograph>& photographs) {
  const size_t count = photographs.size();
  if (count <= kMostForEachWithEach) {
    return {PairSelection::kExhaustive, absl::StrCat("each with each, as there are only ", count)};
  }
  if (AreVideoFrames(photographs)) {
    return {PairSelection::kSequential, "each with those that follow and those that look alike: frames of a video"};
  }
  return {PairSelection::kSimilar,
          absl::StrCat("each with those that look alike, as each with each of ", count, " would take too long")};
}

std::vector<ImagePair> PairsByNumber(PairSelection selection, int64_t images) {
  int64_t following = 0;
  if (selection == PairSelection::kExhaustive) following = images;
  if (selection == PairSelection::kSequential) following = kFollowing;
  std::vector<ImagePair> pairs;
  for (int64_t i = 1; i <= images; ++i) {
    for (int64_t j = i + 1; j <= std::min(images, i + following); ++j) pairs.emplace_back(i, j);
  }
  return pairs;
}

size_t SimilarPerPhotograph(PairSelection selection) {
  switch (selection) {
    case PairSelection::kExhaustive:
      return 0;
    case PairSelection::kSequential:
      return kSimilarFrames;
    case PairSelection::kSimilar:
      return kSimilarPhotographs;
  }
  return 0;
}

}  // namespace meshwright
