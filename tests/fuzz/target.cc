// SPDX-License-Identifier: Apache-2.0
#include "tests/fuzz/target.h"

#include <iterator>
#include <utility>

namespace meshwright::fuzz {

const std::vector<Target>& Targets() {
  static const auto* const targets = [] {
    auto* const all = new std::vector<Target>();
    for (auto some : {SceneTargets(), GeometryTargets(), TextTargets(), ServiceTargets()}) {
      all->insert(all->end(), std::make_move_iterator(some.begin()), std::make_move_iterator(some.end()));
    }
    return all;
  }();
  return *targets;
}

const Target* FindTarget(const std::string& name) {
  for (const Target& target : Targets()) {
    if (target.name == name) return &target;
  }
  return nullptr;
}

}  // namespace meshwright::fuzz
