// SPDX-License-Identifier: Apache-2.0
#include "common/scene/formats/masks.h"

#include <algorithm>
#include <filesystem>
#include <set>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>

#include "common/scene/formats/assemble.h"

namespace meshwright {
namespace {

namespace fs = std::filesystem;

constexpr char kMasks[] = "masks";

std::vector<std::string> MasksFolders(const std::vector<std::string>& image_folders) {
  std::vector<std::string> folders;
  for (const std::string& folder : image_folders) {
    for (const std::string& candidate :
         {JoinPath(folder, kMasks), NameOfFolder(folder) == "images" ? JoinPath(folder, "../masks") : std::string()}) {
      const bool known = std::find(folders.begin(), folders.end(), candidate) != folders.end();
      if (!candidate.empty() && !known && IsFolder(candidate)) folders.push_back(candidate);
    }
  }
  return folders;
}

// Names that a mask of the photograph may have; "a/b.jpg" -> "a/b.jpg.png".
std::vector<std::string> NamesFor(const std::string& photograph, bool in_masks_folder) {
  const std::string stem = fs::path(photograph).replace_extension().string();
  std::vector<std::string> names = {photograph + ".png"};
  if (in_masks_folder) names.push_back(stem + ".png");
  for (const char* ending : {"_mask.png", "_mask.jpg", "_mask.jpeg", "_mask.JPG", ".mask.png"}) {
    names.push_back(stem + ending);
  }
  return names;
}

std::string FindMask(const SceneView& view, const std::vector<std::string>& masks_folders, bool also_beside) {
  for (const std::string& folder : masks_folders) {
    // A name with folders in it, and its last part alone.
    for (const std::string& photograph : {view.name, fs::path(view.image_path).filename().string()}) {
      for (const std::string& name : NamesFor(photograph, true)) {
        std::string path = JoinPath(folder, name);
        // In a folder of both, STEM.png may be the photograph itself.
        if (IsFile(path) && path != fs::path(view.image_path).lexically_normal().string()) return path;
      }
    }
  }
  for (const std::string& path : NamesFor(view.image_path, false)) {
    if (also_beside && IsFile(path)) return path;
  }
  return "";
}

// Relative to its folder, sorted.
std::vector<std::string> FilesBelow(const std::string& folder) {
  std::vector<std::string> files;
  std::error_code error;
  auto it = fs::recursive_directory_iterator(folder, error);
  for (; !error && it != fs::recursive_directory_iterator(); it.increment(error)) {
    std::error_code ignored;
    if (it->is_regular_file(ignored)) files.push_back(it->path().lexically_normal().string());
  }
  std::sort(files.begin(), files.end());
  return files;
}

}  // namespace

absl::Status FindMasks(const std::vector<std::string>& image_folders, const std::string& masks_folder, Scene* scene) {
  if (!masks_folder.empty() && !IsFolder(masks_folder)) {
    return absl::NotFoundError(absl::StrCat(masks_folder, ": no such folder; expected the photographs' masks"));
  }
  const std::vector<std::string> folders =
      masks_folder.empty() ? MasksFolders(image_folders) : std::vector<std::string>{masks_folder};
  std::set<std::string> used;
  for (SceneView& view : scene->views) {
    view.mask_path = FindMask(view, folders, masks_folder.empty());
    if (!view.mask_path.empty()) used.insert(fs::path(view.mask_path).lexically_normal().string());
  }
  if (!masks_folder.empty() && used.empty()) {
    return absl::NotFoundError(absl::StrCat(masks_folder, ": no mask of a photograph; expected for example ",
                                            scene->views.front().name, ".png"));
  }
  std::vector<std::string> unused;
  for (const std::string& folder : folders) {
    for (std::string& file : FilesBelow(folder)) {
      if (!used.contains(file)) unused.push_back(std::move(file));
    }
  }
  if (!unused.empty()) {
    const size_t named = std::min<size_t>(unused.size(), 3);
    scene->warnings.push_back(
        absl::StrCat(unused.size(), " masks belong to no photograph (a mask is called as its photograph, then .png): ",
                     absl::StrJoin(unused.begin(), unused.begin() + static_cast<std::ptrdiff_t>(named), ", "),
                     unused.size() > named ? " ..." : ""));
  }
  return absl::OkStatus();
}

}  // namespace meshwright
