// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

namespace meshwright {

// Which of `names` somebody meant who wrote `word`: the one with the fewest letters to insert, delete, change or swap
// with the next (the first of several). "" where more than a third of the letters would have to change.
std::string NearestName(const std::string& word, const std::vector<std::string>& names);

// ", did you mean NAME?", with `prefix` before the name; "" where no name is near.
std::string DidYouMean(const std::string& word, const std::vector<std::string>& names, const std::string& prefix = "");

}  // namespace meshwright
