// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include <absl/status/statusor.h>

#include "common/blob/blob_store.h"
#include "common/scene/scene.h"

namespace meshwright {

// A scene of the store, whose photographs and masks are blobs, with files in `folder` in their places. The folder is
// made where it is missing; the caller removes it. Errors are the BlobStore's.
absl::StatusOr<Scene> WithPhotographFiles(Scene scene, BlobStore& blobs, const std::string& folder);

}  // namespace meshwright
