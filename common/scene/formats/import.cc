#include "common/scene/formats/import.h"

#include <vector>

#include <absl/status/status.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>

#include "common/scene/formats/assemble.h"
#include "common/scene/formats/formats.h"

namespace meshwright {
namespace {

absl::StatusOr<Scene> ImportForced(const std::string& path, const std::string& name) {
  std::vector<std::string> names;
  for (const SceneFormat& format : SceneFormats()) {
    if (name == format.name) {
      const std::string folder = format.find(path);
      if (!folder.empty()) return format.import(folder);
      return absl::NotFoundError(absl::StrCat(path, ": no ", name, " scene; expected ", format.looks_for));
    }
    names.emplace_back(format.name);
  }
  return absl::InvalidArgumentError(
      absl::StrCat("format is ", Quoted(name), "; expected one of ", absl::StrJoin(names, ", ")));
}

}  // namespace

absl::StatusOr<Scene> ImportScene(const std::string& path, const std::optional<std::string>& format) {
  if (!IsFolder(path)) {
    if (IsFile(path)) return absl::InvalidArgumentError(absl::StrCat(path, ": a file; expected a scene's folder"));
    return absl::NotFoundError(absl::StrCat(path, ": no such folder; expected a scene's folder"));
  }
  if (format.has_value()) return ImportForced(path, *format);

  std::vector<SceneFormat> found;
  std::vector<std::string> looked_for;
  for (const SceneFormat& candidate : SceneFormats()) {
    looked_for.push_back(absl::StrCat(candidate.looks_for, " (", candidate.name, ")"));
    if (candidate.find(path).empty()) continue;
    const bool text_beside_binary = !found.empty() && found.back().name == std::string("colmap-binary") &&
                                    candidate.name == std::string("colmap-text");
    if (!text_beside_binary) found.push_back(candidate);
  }
  if (found.empty()) {
    return absl::InvalidArgumentError(
        absl::StrCat(path, ": no scene of a known format; expected one of: ", absl::StrJoin(looked_for, "; ")));
  }
  if (found.size() > 1) {
    return absl::InvalidArgumentError(absl::StrCat(path, ": looks like ", found[0].name, " and like ", found[1].name,
                                                   "; expected one, or a format that is named"));
  }
  return found.front().import(found.front().find(path));
}

}  // namespace meshwright
