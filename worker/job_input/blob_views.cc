// SPDX-License-Identifier: Apache-2.0
#include "worker/job_input/blob_views.h"

#include <string>

#include "common/base/status_macros.h"

namespace meshwright {

absl::StatusOr<View> LoadViewFromBlobs(SceneView view, int max_image_size, BlobStore& blobs) {
  MW_ASSIGN_OR_RETURN(const std::string picture, blobs.Get(view.image_path));
  std::string mask;
  if (!view.mask_path.empty()) {
    MW_ASSIGN_OR_RETURN(mask, blobs.Get(view.mask_path));
    view.mask_path = view.name + " (its mask)";
  }
  view.image_path = view.name;  // what errors should name
  return DecodeView(view, picture, mask, max_image_size);
}

}  // namespace meshwright
