// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <absl/status/statusor.h>

#include "common/blob/blob_store.h"
#include "common/scene/view.h"

namespace meshwright {

// A view of a scene whose image_path and mask_path are digests of blobs, ready for use. Errors are the BlobStore's, or
// DecodeView's with the view's name in place of a file's.
absl::StatusOr<View> LoadViewFromBlobs(SceneView view, int max_image_size, BlobStore& blobs);

}  // namespace meshwright
