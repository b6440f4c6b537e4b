// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include <absl/status/statusor.h>

namespace meshwright {

// A setting that was given otherwise than on the command line.
struct Setting {
  std::string name;  // "scene-root"
  std::string value;
  std::string source;  // where it is said: "/etc/coordinator.conf:3", "MESHWRIGHT_SCENE_ROOT"
};

// The lines "name = value" of a configuration file, in their order. Values may stand in quotes. Empty lines and lines
// that begin with # or ; say nothing. `path` is for messages: InvalidArgument names it with the line.
absl::StatusOr<std::vector<Setting>> ParseSettingsFile(const std::string& path, const std::string& text);

}  // namespace meshwright
