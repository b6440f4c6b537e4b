// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "program/settings_file.h"

namespace meshwright {

// MESHWRIGHT_SCENE_ROOT for "scene-root".
std::string EnvironmentNameOf(const std::string& setting);

// What the environment says of a program's settings, of which `names` are all. A variable that is empty says nothing.
// InvalidArgument where a variable MESHWRIGHT_... is a setting of no program of Meshwright, with the nearest name. What
// Kubernetes and Docker make of the names of services (..._SERVICE_HOST, ..._PORT_7420_TCP) is passed over.
absl::StatusOr<std::vector<Setting>> SettingsOfEnvironment(const std::vector<std::string>& names);

}  // namespace meshwright
