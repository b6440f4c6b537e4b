#include "common/scene/import.h"

#include <vector>

#include <absl/status/status.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>

#include "common/scene/assemble.h"
#include "common/scene/colmap_binary.h"
#include "common/scene/colmap_model.h"
#include "common/scene/colmap_text.h"
#include "common/scene/middlebury.h"
#include "common/scene/strecha.h"

namespace meshwright {
namespace {

struct Format {
  const char* name;
  std::string looks_for;
  // The folder that Import takes; empty when `path` has no such scene.
  std::string (*find)(const std::string& path);
  absl::StatusOr<Scene> (*import)(const std::string& folder);
};

std::vector<Format> KnownFormats() {
  return {
      {"colmap-binary", ColmapModelFiles("bin"),
       [](const std::string& path) { return FindColmapModelFolder(path, "bin"); }, ImportColmapBinary},
      {"colmap-text", ColmapModelFiles("txt"),
       [](const std::string& path) { return FindColmapModelFolder(path, "txt"); }, ImportColmapText},
      {"middlebury", "*_par.txt",
       [](const std::string& path) { return FilesEndingIn(path, "_par.txt").empty() ? std::string() : path; },
       ImportMiddlebury},
      {"strecha", "*.camera here or in cameras/",
       [](const std::string& path) { return FindStrechaCameras(path).empty() ? std::string() : path; }, ImportStrecha},
  };
}

absl::StatusOr<Scene> ImportForced(const std::string& path, const std::string& name) {
  std::vector<std::string> names;
  for (const Format& format : KnownFormats()) {
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

  std::vector<Format> found;
  std::vector<std::string> looked_for;
  for (const Format& candidate : KnownFormats()) {
    looked_for.push_back(absl::StrCat(candidate.looks_for, " (", candidate.name, ")"));
    if (candidate.find(path).empty()) continue;
    const bool text_beside_binary =
        !found.empty() && found.back().name == std::string("colmap-binary") && candidate.import == ImportColmapText;
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
