// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <numeric>
#include <utility>
#include <vector>

namespace meshwright {

// Sets of the numbers 0 .. count - 1 that can be joined. The smallest number of a set is its root.
class DisjointSets {
 public:
  explicit DisjointSets(size_t count) : parent_(count) { std::iota(parent_.begin(), parent_.end(), 0); }

  int32_t Root(int32_t i) {
    while (Parent(i) != i) {
      Parent(i) = Parent(Parent(i));
      i = Parent(i);
    }
    return i;
  }

  void Join(int32_t i, int32_t j) {
    i = Root(i);
    j = Root(j);
    if (i > j) std::swap(i, j);
    Parent(j) = i;
  }

 private:
  int32_t& Parent(int32_t i) { return parent_[static_cast<size_t>(i)]; }

  std::vector<int32_t> parent_;
};

}  // namespace meshwright
