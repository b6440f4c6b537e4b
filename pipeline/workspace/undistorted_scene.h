// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "pipeline/workspace/workspace.h"

#include "common/scene/scene.h"
#include "common/scene/view.h"

namespace meshwright {

// Writes each photograph, undistorted and scaled, into images/ of the workspace, and returns the scene with the pinhole
// lenses that they then have. Names stay, but for an ending .png where the file is one now. `use` gets each view and
// its name in the new scene, in order.
absl::StatusOr<Scene> WriteUndistortedScene(
    const Scene& scene, const WorkspaceSettings& settings, const WorkspaceProgress& progress,
    const std::function<absl::Status(const View& view, const std::string& name)>& use);

}  // namespace meshwright
