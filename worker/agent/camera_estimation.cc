// SPDX-License-Identifier: Apache-2.0
#include "worker/agent/camera_estimation.h"

#include <chrono>
#include <filesystem>
#include <system_error>

#include <absl/strings/str_cat.h>
#include <sys/stat.h>
#include <unistd.h>

#include "common/base/bad_input.h"
#include "common/base/digest.h"
#include "common/base/relative_path.h"
#include "common/base/status_macros.h"
#include "common/scene/scene_codec.h"

namespace meshwright {
namespace {

namespace fs = std::filesystem;

constexpr std::chrono::hours kKeepUnfinished(7 * 24);

absl::Status MakeFolder(const fs::path& folder) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (!error) return absl::OkStatus();
  return absl::UnavailableError(absl::StrCat(folder.string(), ": cannot make the folder: ", error.message()));
}

// In a folder that all may write to, somebody else may have been first with this name.
absl::Status MakeOwnFolder(const fs::path& folder) {
  struct stat status = {};
  if (::mkdir(folder.c_str(), 0700) == 0) return absl::OkStatus();
  const bool is_ours = ::lstat(folder.c_str(), &status) == 0 && S_ISDIR(status.st_mode) &&
                       status.st_uid == ::geteuid() && (status.st_mode & 0022) == 0;
  if (is_ours) return absl::OkStatus();
  return absl::UnavailableError(
      absl::StrCat(folder.string(), ": cannot be made, or is not this user's alone; set TMPDIR to another folder"));
}

// What was begun and never ended here: another machine did it, or nobody wanted it any more.
void RemoveOldFolders(const fs::path& work_folder) {
  std::error_code error;
  const auto oldest = fs::file_time_type::clock::now() - kKeepUnfinished;
  for (const auto& entry : fs::directory_iterator(work_folder, error)) {
    const fs::file_time_type last = fs::last_write_time(entry.path() / "scene/colmap/log.txt", error);
    if (!error && last < oldest) fs::remove_all(entry.path(), error);
  }
}

// A file appears whole, so what is there need not be fetched again.
absl::Status LayOut(const v1::CameraJob& job, BlobStore& blobs, const fs::path& folder) {
  for (const v1::Photograph& photograph : job.photographs()) {
    MW_RETURN_IF_ERROR(ValidateRelativePath(photograph.path()));
    const fs::path path = folder / photograph.path();
    std::error_code error;
    if (fs::exists(path, error)) continue;
    MW_RETURN_IF_ERROR(MakeFolder(path.parent_path()));
    MW_RETURN_IF_ERROR(blobs.GetFile(photograph.digest(), path.string()));
  }
  return absl::OkStatus();
}

std::string DigestOf(const v1::CameraJob& job) {
  std::string names;
  for (const v1::Photograph& photograph : job.photographs()) {
    absl::StrAppend(&names, photograph.path(), "\n", photograph.digest(), "\n");
  }
  return Sha256Hex(names);
}

}  // namespace

absl::StatusOr<FinishedJob> EstimateCamerasOf(const v1::CameraJob& job, const CameraEstimator& estimator,
                                              BlobStore& blobs, const std::string& work_folder, int threads,
                                              const std::function<bool()>& stop,
                                              const std::function<void(const std::string&, double)>& progress) {
  const fs::path folder = fs::path(work_folder) / absl::StrCat("cameras-", DigestOf(job).substr(0, 16));
  const fs::path photographs = folder / "photographs";
  MW_RETURN_IF_ERROR(MakeOwnFolder(work_folder));
  RemoveOldFolders(work_folder);
  MW_RETURN_IF_ERROR(MakeFolder(photographs));
  MW_RETURN_IF_ERROR(LayOut(job, blobs, photographs));
  const absl::StatusOr<CameraEstimator::Result> result = estimator.estimate({.photographs = photographs.string(),
                                                                             .scene = (folder / "scene").string(),
                                                                             .threads = threads,
                                                                             .stop = stop,
                                                                             .progress = progress});
  FinishedJob finished;
  if (result.ok()) {
    MW_ASSIGN_OR_RETURN(finished.filtered_digest, blobs.Put(EncodeScene(result->scene)));
    finished.report_json = result->report_json;
  }
  std::error_code error;
  const bool is_over = result.ok() || IsBadInput(result.status()) || absl::IsFailedPrecondition(result.status());
  if (is_over) fs::remove_all(folder, error);
  if (!result.ok()) return result.status();
  return finished;
}

}  // namespace meshwright
