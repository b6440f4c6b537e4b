// SPDX-License-Identifier: Apache-2.0
#include "common/scene/formats/import.h"

#include <algorithm>
#include <vector>

#include <absl/status/status.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>

#include "common/base/status_macros.h"
#include "common/scene/formats/assemble.h"
#include "common/scene/formats/colmap_binary.h"
#include "common/scene/formats/colmap_text.h"
#include "common/scene/formats/formats.h"
#include "common/scene/formats/region_file.h"

namespace meshwright {
namespace {

absl::StatusOr<Scene> ImportForced(const std::string& path, const ImportOptions& options) {
  std::vector<std::string> names;
  for (const SceneFormat& format : SceneFormats()) {
    if (*options.format == format.name) {
      const std::string found = format.find(path);
      if (!found.empty()) {
        MW_ASSIGN_OR_RETURN(Scene scene, format.import(found, options));
        MW_RETURN_IF_ERROR(SetRegion(options.region, path, &scene));
        return scene;
      }
      return absl::NotFoundError(absl::StrCat(path, ": no ", format.name, " scene; expected ", format.looks_for));
    }
    names.emplace_back(format.name);
  }
  return absl::InvalidArgumentError(
      absl::StrCat("format is ", Quoted(*options.format), "; expected one of ", absl::StrJoin(names, ", ")));
}

// A COLMAP model that is there in both forms is one scene, not two.
bool IsSameModelInText(const SceneFormat& taken, const std::string& taken_at, const SceneFormat& other,
                       const std::string& other_at) {
  return taken.import == ImportColmapBinary && other.import == ImportColmapText && taken_at == other_at;
}

}  // namespace

absl::StatusOr<Scene> ImportScene(const std::string& path, const ImportOptions& options) {
  if (!IsFolder(path)) {
    if (IsFile(path)) return absl::InvalidArgumentError(absl::StrCat(path, ": a file; expected a scene's folder"));
    return absl::NotFoundError(absl::StrCat(path, ": no such folder; expected a scene's folder"));
  }
  if (options.format.has_value()) return ImportForced(path, options);

  const SceneFormat* taken = nullptr;
  std::string taken_at;
  std::vector<std::string> warnings;
  std::vector<std::string> looked_for;
  for (const SceneFormat& candidate : SceneFormats()) {
    looked_for.push_back(absl::StrCat(candidate.looks_for, " (", candidate.name, ")"));
    const std::string found = candidate.find(path);
    if (found.empty()) continue;
    if (taken == nullptr) {
      taken = &candidate;
      taken_at = found;
    } else if (!IsSameModelInText(*taken, taken_at, candidate, found)) {
      warnings.push_back(absl::StrCat("read as ", taken->name, "; the folder also looks like ", candidate.name, " (",
                                      found, "), which --format ", candidate.name, " would read"));
    }
  }
  if (taken == nullptr) {
    return absl::InvalidArgumentError(
        absl::StrCat(path, ": no scene of a known format; expected one of: ", absl::StrJoin(looked_for, "; ")));
  }
  MW_ASSIGN_OR_RETURN(Scene scene, taken->import(taken_at, options));
  scene.warnings.insert(scene.warnings.end(), warnings.begin(), warnings.end());
  MW_RETURN_IF_ERROR(SetRegion(options.region, path, &scene));
  return scene;
}

bool HoldsScene(const std::string& path) {
  return std::any_of(SceneFormats().begin(), SceneFormats().end(),
                     [&](const SceneFormat& format) { return !format.find(path).empty(); });
}

}  // namespace meshwright
