#include "coordinator/conductor/scene_ingestion.h"

#include <filesystem>
#include <optional>
#include <utility>

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>

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

bool IsBelow(const fs::path& path, const fs::path& root) {
  auto at = path.begin();
  for (const fs::path& part : root) {
    if (part.empty()) continue;  // a "/" at the end
    if (at == path.end() || *at != part) return false;
    ++at;
  }
  return true;
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

absl::StatusOr<IngestedScene> IngestScene(const std::string& folder, ReferencedBlobs& blobs, ThreadPool& pool) {
  absl::StatusOr<Scene> scene = ImportScene(folder);
  if (!scene.ok()) return BadInput(scene.status());
  IngestedScene taken;
  MW_ASSIGN_OR_RETURN(taken.scene_digest, CheckAndDigestScene(*scene, pool, [](int) {}));
  for (SceneView& view : scene->views) {
    MW_ASSIGN_OR_RETURN(const std::string bytes, ReadFile(view.image_path));
    MW_ASSIGN_OR_RETURN(view.image_path, blobs.Put(bytes));
  }
  MW_ASSIGN_OR_RETURN(taken.scene_blob, blobs.Put(EncodeScene(*scene)));
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
// SPDX-License-Identifier: Apache-2.0
