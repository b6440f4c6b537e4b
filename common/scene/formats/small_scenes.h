// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <string>

#include "common/scene/scene.h"

// Small valid scenes on disk for the tests of the importers.
namespace meshwright {

// A folder below the tests' temporary folder, emptied.
std::string FreshFolder(const std::string& name);

// Files by their path within the scene's folder.
using SceneFiles = std::map<std::string, std::string>;
void WriteScene(const std::string& folder, const SceneFiles& files);

constexpr int kSmallWidth = 12;   // px
constexpr int kSmallHeight = 10;  // px
// A picture of that size, as PNG.
std::string SmallPicture();

// Each has three views, b.png, a.png and c.png, in this order; COLMAP's have four points too, two lenses and an image
// without observations.
SceneFiles SmallColmapText();
SceneFiles SmallColmapBinary();
SceneFiles SmallMiddlebury();
SceneFiles SmallStrecha();

}  // namespace meshwright
