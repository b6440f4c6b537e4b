// SPDX-License-Identifier: Apache-2.0
#include "coordinator/main/list_photographs.h"

#include <filesystem>

#include "pipeline/cameras/photograph_folder.h"

#include "common/base/relative_path.h"
#include "common/base/status_macros.h"

namespace meshwright {

absl::StatusOr<std::vector<PhotographFile>> ListPhotographFiles(const std::string& folder) {
  std::vector<PhotographFile> files;
  if (!HoldsPhotographs(folder)) return files;
  MW_ASSIGN_OR_RETURN(const PhotographFolder found, ListPhotographs(folder));
  for (const Photograph& photograph : found.photographs) {
    files.push_back({.path = photograph.name, .local_path = photograph.path});
    if (photograph.mask_path.empty()) continue;
    const std::string mask = std::filesystem::path(photograph.mask_path).lexically_relative(folder).string();
    // One beside the folder is not the scene's.
    if (ValidateRelativePath(mask).ok()) files.push_back({.path = mask, .local_path = photograph.mask_path});
  }
  return files;
}

}  // namespace meshwright
