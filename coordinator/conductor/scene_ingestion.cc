// SPDX-License-Identifier: Apache-2.0
#include "coordinator/conductor/scene_ingestion.h"

#include <cstdint>
#include <filesystem>
#include <set>
#include <system_error>
#include <utility>
#include <vector>

#include <absl/strings/cord.h>
#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_replace.h>

#include "common/base/bad_input.h"
#include "common/base/files.h"
#include "common/base/relative_path.h"
#include "common/base/status_macros.h"
#include "common/blob/lost_blob.h"
#include "common/scene/formats/import.h"
#include "common/scene/scene_check.h"
#include "common/scene/scene_codec.h"

namespace meshwright {
namespace {

namespace fs = std::filesystem;

constexpr char kFileScheme[] = "file:";
constexpr int64_t kMaxEntries = 1'000'000;
// Photographs that are put into the blob store at a time: each waits for a disk and a database. So many are in memory.
constexpr int kPutAtOnce = 4;

bool IsBelow(const fs::path& path, const fs::path& root) {
  auto at = path.begin();
  for (const fs::path& part : root) {
    if (part.empty()) continue;  // a "/" at the end
    if (at == path.end() || *at != part) return false;
    ++at;
  }
  return true;
}

// Links may point to anything below `root`. What is neither a file nor a folder would be waited for, or read for ever.
absl::Status CheckLinks(const fs::path& folder, const fs::path& root) {
  std::vector<fs::path> folders = {folder};
  std::set<fs::path> seen;
  for (int64_t entries = 0; !folders.empty();) {
    std::error_code error;
    const fs::path at = fs::canonical(folders.back(), error);
    folders.pop_back();
    if (error || !seen.insert(at).second) continue;
    for (const fs::directory_entry& entry : fs::directory_iterator(at, error)) {
      if (++entries > kMaxEntries) {
        return BadInput(absl::InvalidArgumentError(absl::StrCat("the scene has more than ", kMaxEntries, " files")));
      }
      std::error_code of_entry;
      if (!entry.is_symlink(of_entry) && entry.is_regular_file(of_entry)) continue;
      const fs::path real = fs::canonical(entry.path(), of_entry);
      const std::string name = entry.path().lexically_relative(folder).string();
      if (of_entry) continue;  // a link to nothing is read by nobody
      if (!IsBelow(real, root)) {
        return BadInput(
            absl::InvalidArgumentError(absl::StrCat("path \"", name, "\": a link that leaves the scene's folder")));
      }
      if (fs::is_directory(real, of_entry)) {
        folders.push_back(real);
      } else if (!fs::is_regular_file(real, of_entry)) {
        return BadInput(
            absl::InvalidArgumentError(absl::StrCat("path \"", name, "\": a device or pipe, expected a file")));
      }
    }
  }
  return absl::OkStatus();
}

absl::Status CheckPhotographs(const Scene& scene, const fs::path& root) {
  for (const SceneView& view : scene.views) {
    for (const std::string& path : {view.image_path, view.mask_path}) {
      std::error_code error;
      const fs::path real = fs::canonical(path, error);
      if (path.empty() || error || IsBelow(real, root)) continue;  // what is not there is said by whoever reads it
      return BadInput(absl::InvalidArgumentError(
          absl::StrCat("photograph \"", view.name.substr(0, 100), "\" lies outside of the scene's folder")));
    }
  }
  return absl::OkStatus();
}

// The same error, which calls files by their paths in the folder.
absl::Status Inside(const std::string& folder, const absl::Status& status) {
  // The folder itself, as one of several places, is ".".
  absl::Status inside(
      status.code(),
      absl::StrReplaceAll(status.message(), {{folder + "/;", ".;"}, {folder + "/,", ".,"}, {folder + "/", ""}}));
  status.ForEachPayload([&](absl::string_view name, const absl::Cord& payload) { inside.SetPayload(name, payload); });
  return inside;
}

absl::StatusOr<fs::path> RealRoot(const std::string& root) {
  std::error_code error;
  const fs::path real_root = fs::canonical(root, error);
  if (error) return absl::UnavailableError(absl::StrCat(root, ": ", error.message()));
  return real_root;
}

absl::Status PutPhotographsOf(ReferencedBlobs& blobs, SceneView& view) {
  MW_ASSIGN_OR_RETURN(const std::string bytes, ReadFile(view.image_path));
  MW_ASSIGN_OR_RETURN(view.image_path, blobs.Put(bytes));
  if (view.mask_path.empty()) return absl::OkStatus();
  MW_ASSIGN_OR_RETURN(const std::string mask, ReadFile(view.mask_path));
  MW_ASSIGN_OR_RETURN(view.mask_path, blobs.Put(mask));
  return absl::OkStatus();
}

// Paths become digests.
absl::Status PutPhotographs(ReferencedBlobs& blobs, Scene& scene) {
  std::vector<absl::Status> put(scene.views.size());
  ThreadPool waiting(kPutAtOnce);
  waiting.ParallelFor(static_cast<int64_t>(scene.views.size()), 1, [&](int64_t begin, int64_t end) {
    for (auto i = static_cast<size_t>(begin); i < static_cast<size_t>(end); ++i) {
      put[i] = PutPhotographsOf(blobs, scene.views[i]);
    }
  });
  for (const absl::Status& status : put) MW_RETURN_IF_ERROR(status);
  return absl::OkStatus();
}

absl::StatusOr<IngestedScene> IngestConfined(Scene scene, const std::string& root, ReferencedBlobs& blobs,
                                             ThreadPool& pool) {
  MW_ASSIGN_OR_RETURN(const fs::path real_root, RealRoot(root));
  MW_RETURN_IF_ERROR(CheckPhotographs(scene, real_root));
  IngestedScene taken;
  MW_ASSIGN_OR_RETURN(taken.scene_digest, CheckAndDigestScene(scene, pool, [](int) {}));
  MW_RETURN_IF_ERROR(PutPhotographs(blobs, scene));
  MW_ASSIGN_OR_RETURN(taken.scene_blob, blobs.Put(EncodeScene(scene)));
  return taken;
}

}  // namespace

absl::StatusOr<std::string> ResolveSceneReference(const std::string& reference, const std::vector<std::string>& roots) {
  if (!absl::StartsWith(reference, kFileScheme)) {
    return absl::InvalidArgumentError(
        absl::StrCat("scene_reference is \"", reference, "\", expected file:FOLDER below a root of scenes"));
  }
  const std::string relative = reference.substr(sizeof(kFileScheme) - 1);
  if (const absl::Status valid = ValidateRelativePath(relative); !valid.ok()) {
    return absl::InvalidArgumentError(absl::StrCat("scene_reference: ", std::string(valid.message())));
  }
  for (const std::string& root : roots) {
    std::error_code error;
    const fs::path real_root = fs::canonical(root, error);
    if (error) continue;
    const fs::path real = fs::canonical(real_root / relative, error);
    if (error || !fs::is_directory(real, error)) continue;
    if (IsBelow(real, real_root)) return real.string();
  }
  return absl::NotFoundError(
      absl::StrCat("scene_reference \"", reference, "\": no such folder below the ", roots.size(), " roots of scenes"));
}

std::string SceneRootOf(const std::string& folder, const std::vector<std::string>& roots) {
  for (const std::string& root : roots) {
    std::error_code error;
    const fs::path real_root = fs::canonical(root, error);
    if (!error && IsBelow(folder, real_root)) return real_root.string();
  }
  return folder;
}

absl::Status CheckConfined(const std::string& folder, const std::string& root) {
  MW_ASSIGN_OR_RETURN(const fs::path real_root, RealRoot(root));
  return CheckLinks(folder, real_root);
}

absl::StatusOr<Scene> ReadScene(const std::string& folder) {
  absl::StatusOr<Scene> scene = ImportScene(folder);
  if (!scene.ok()) return Inside(folder, BadInput(scene.status()));
  return scene;
}

absl::StatusOr<IngestedScene> IngestScene(Scene scene, const std::string& folder, const std::string& root,
                                          ReferencedBlobs& blobs, ThreadPool& pool) {
  absl::StatusOr<IngestedScene> taken = IngestConfined(std::move(scene), root, blobs, pool);
  if (!taken.ok()) return Inside(folder, taken.status());
  return taken;
}

absl::Status MaterializeScene(const std::vector<SceneFile>& files, BlobStore& blobs, const std::string& folder) {
  std::error_code error;
  fs::remove_all(folder, error);
  fs::create_directories(folder, error);
  if (error) return absl::PermissionDeniedError(absl::StrCat(folder, ": cannot make the folder: ", error.message()));
  for (const SceneFile& file : files) {
    const fs::path path = fs::path(folder) / file.path;
    fs::create_directories(path.parent_path(), error);
    if (error) {
      return BadInput(absl::InvalidArgumentError(
          absl::StrCat("path \"", file.path, "\": cannot make its folder: ", error.message())));
    }
    const absl::Status got = blobs.GetFile(file.digest, path.string());
    if (IsBlobLost(got)) {
      return absl::DataLossError(
          absl::StrCat("the uploaded file ", file.path, " is damaged or lost (blob ", file.digest, ")"));
    }
    MW_RETURN_IF_ERROR(got);
  }
  return absl::OkStatus();
}

}  // namespace meshwright
