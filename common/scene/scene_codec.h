// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include <absl/status/statusor.h>

#include "common/scene/scene.h"

namespace meshwright {

// A scene as bytes, for sending it to other machines: every value comes back bit by bit, so jobs do the same with it.
// Pictures are not in it; image_path travels as it is (the service puts the digests of their blobs there).
std::string EncodeScene(const Scene& scene);

// InvalidArgument when `bytes` are not what EncodeScene makes: truncated, changed, or of another version.
absl::StatusOr<Scene> DecodeScene(const std::string& bytes);

}  // namespace meshwright
