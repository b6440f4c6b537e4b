// SPDX-License-Identifier: Apache-2.0
#include "pipeline/local/work_folder.h"

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <system_error>
#include <utility>
#include <vector>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>
#include <sys/stat.h>

#include "pipeline/options/options_json.h"

#include "common/base/method_version.h"
#include "common/base/status_macros.h"
#include "common/blob/filesystem_blob_store.h"
#include "common/json/parse_json.h"
#include "coordinator/store/sqlite_job_store.h"

namespace meshwright {
namespace {

namespace fs = std::filesystem;

constexpr char kState[] = "state.sqlite";
constexpr char kBlobs[] = "blobs";
constexpr char kRefinement[] = "cameras.json";
constexpr char kMesh[] = "mesh.ply";

absl::Status SystemError(const std::string& path, const std::string& what, int error) {
  const std::string message = absl::StrCat(path, ": ", what, ": ", std::strerror(error));
  if (error == ENOSPC || error == EDQUOT) return absl::ResourceExhaustedError(message);
  if (error == ENOENT) return absl::NotFoundError(message);
  return absl::PermissionDeniedError(message);
}

// A folder that holds something but no lock of ours is somebody else's.
absl::Status CheckIsOurs(const std::string& path) {
  std::error_code error;
  if (!fs::is_directory(path, error)) {
    return absl::FailedPreconditionError(absl::StrCat(path, ": a folder to work in expected"));
  }
  const bool empty = fs::is_empty(path, error);
  if (error) return SystemError(path, "cannot look into the folder", error.value());
  if (!empty && !fs::exists(fs::path(path) / FolderLock::kFileName, error)) {
    return absl::FailedPreconditionError(
        absl::StrCat(path, ": not empty and not a work folder; name another with --work-dir"));
  }
  return absl::OkStatus();
}

}  // namespace

WorkFolder::WorkFolder(std::string path, FolderLock lock) : path_(std::move(path)), lock_(std::move(lock)) {}

WorkFolder::~WorkFolder() = default;

absl::StatusOr<std::unique_ptr<WorkFolder>> WorkFolder::Open(const std::string& path, const std::string& scene_digest,
                                                             const std::string& options_json, bool restart,
                                                             const Clock& clock) {
  if (::mkdir(path.c_str(), 0755) != 0 && errno != EEXIST) {
    return SystemError(path, "cannot make the work folder", errno);
  }
  MW_RETURN_IF_ERROR(CheckIsOurs(path));
  MW_ASSIGN_OR_RETURN(FolderLock lock, FolderLock::Acquire(path));
  auto folder = std::unique_ptr<WorkFolder>(new WorkFolder(path, std::move(lock)));
  if (restart) MW_RETURN_IF_ERROR(folder->RemoveContents());
  MW_RETURN_IF_ERROR(folder->OpenStores(scene_digest, options_json, clock));
  return folder;
}

absl::Status WorkFolder::OpenStores(const std::string& scene_digest, const std::string& options_json,
                                    const Clock& clock) {
  MW_ASSIGN_OR_RETURN(blobs_, FilesystemBlobStore::Open(absl::StrCat(path_, "/", kBlobs)));
  MW_ASSIGN_OR_RETURN(store_, OpenSqliteJobStore(absl::StrCat(path_, "/", kState)));
  const absl::StatusOr<Reconstruction> stored = store_->GetReconstruction(kReconstructionId);
  if (absl::IsNotFound(stored.status())) {
    return store_->CreateReconstruction(
        {.id = kReconstructionId, .options_json = options_json, .scene_digest = scene_digest}, clock.Now());
  }
  MW_RETURN_IF_ERROR(stored.status());
  std::vector<std::string> differences;
  if (stored->scene_digest != scene_digest) {
    differences.emplace_back("the scene (photographs, cameras or sparse points) is another one");
  }
  if (stored->options_json != options_json) {
    const auto before = ParseJson<nlohmann::ordered_json>(stored->options_json);
    if (!before.ok()) {
      return absl::DataLossError(absl::StrCat(path_, "/", kState, ": the options ", before.status().message()));
    }
    MW_ASSIGN_OR_RETURN(const auto now, ParseJson<nlohmann::ordered_json>(options_json));
    const std::vector<std::string> options = DescribeDifferences(*before, now);
    differences.insert(differences.end(), options.begin(), options.end());
  }
  if (differences.empty() && stored->method_version != kMethodVersion) {
    differences.push_back(DescribeMethods(stored->method_version, kMethodVersion));
  }
  if (!differences.empty()) {
    return absl::FailedPreconditionError(
        absl::StrCat(path_, " holds another reconstruction: ", absl::StrJoin(differences, "; "),
                     "; repeat that command, or begin anew with --restart"));
  }
  resumed_ = true;
  return absl::OkStatus();
}

std::string WorkFolder::RefinementPath() const { return absl::StrCat(path_, "/", kRefinement); }

std::string WorkFolder::MeshPath() const { return absl::StrCat(path_, "/", kMesh); }

absl::Status WorkFolder::RemoveContents() {
  store_.reset();
  blobs_.reset();
  // The state goes first: without it whatever is left of the blobs counts for nothing.
  std::error_code error;
  for (const char* suffix : {"", "-wal", "-shm", "-journal"}) {
    fs::remove(absl::StrCat(path_, "/", kState, suffix), error);
    if (error) return SystemError(path_, "cannot remove the state", error.value());
  }
  fs::remove_all(fs::path(path_) / kBlobs, error);
  if (error) return SystemError(path_, "cannot remove the surfaces", error.value());
  fs::remove(MeshPath(), error);
  if (error) return SystemError(path_, "cannot remove the mesh", error.value());
  fs::remove(RefinementPath(), error);
  if (error) return SystemError(path_, "cannot remove the refined cameras", error.value());
  return absl::OkStatus();
}

absl::Status WorkFolder::Remove() {
  MW_RETURN_IF_ERROR(RemoveContents());
  std::error_code error;
  fs::remove(fs::path(path_) / FolderLock::kFileName, error);
  fs::remove(path_, error);  // stays, silently, when there is something of somebody else in it
  return absl::OkStatus();
}

}  // namespace meshwright
