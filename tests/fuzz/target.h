// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <string>
#include <vector>

namespace meshwright::fuzz {

// A parser of bytes from outside.
struct Target {
  std::string name;
  // Reads the bytes as somebody's who means harm: no input may end the process, whatever it is refused with. What is
  // taken is held to the parser's own promises.
  std::function<void(const std::string& bytes)> run;
  std::vector<std::string> seeds;       // inputs that are right
  std::vector<std::string> dictionary;  // words that mean something to it
};

// All of them.
const std::vector<Target>& Targets();
// Null when there is none of that name.
const Target* FindTarget(const std::string& name);

// Those of one kind each.
std::vector<Target> SceneTargets();
std::vector<Target> GeometryTargets();
std::vector<Target> TextTargets();
std::vector<Target> ServiceTargets();

}  // namespace meshwright::fuzz
