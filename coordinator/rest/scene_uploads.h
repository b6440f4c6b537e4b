// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <absl/types/span.h>

#include "common/base/digest.h"
#include "common/base/mutex.h"
#include "common/blob/staged_blob.h"
#include "coordinator/api/reconstruction_service.h"

namespace meshwright {

// How far the upload of a scene's file is.
struct SceneFileState {
  std::string path;
  int64_t size_bytes = 0;
  std::string sha256;
  int64_t offset_bytes = 0;  // that are there
  bool complete = false;     // the reconstruction has it
  std::string staged_name;   // of the file with the bytes, in the staging folder; "" when there are none
};

// One part of a file: bytes [offset_bytes, offset_bytes + its length).
struct SceneFilePart {
  std::string path;
  int64_t size_bytes = 0;  // of the whole file
  std::string sha256;      // of the whole file
  int64_t offset_bytes = 0;
  std::string part_sha256;  // "" when the part is the whole file
};

class SceneUploads;

// One part on its way. Destroying it without Finish() leaves of the file what was there before.
class ScenePartUpload {
 public:
  ~ScenePartUpload();
  ScenePartUpload(const ScenePartUpload&) = delete;
  ScenePartUpload& operator=(const ScenePartUpload&) = delete;

  // Errors are as SceneUploads::Begin says.
  absl::Status Append(absl::Span<const uint8_t> bytes);
  absl::StatusOr<SceneFileState> Finish();

 private:
  friend class SceneUploads;
  enum class Kind {
    kNew,       // its bytes follow those that are there
    kRepeated,  // it must say the bytes that are there
    kKnown,     // the reconstruction has the file
  };
  ScenePartUpload(SceneUploads& uploads, std::string id, SceneFilePart part, std::string state_path);
  absl::Status CheckPart() const;
  absl::StatusOr<SceneFileState> FinishFile();

  SceneUploads& uploads_;
  const std::string id_;
  const SceneFilePart part_;
  const std::string state_path_;
  Kind kind_ = Kind::kNew;
  SceneFileState state_;
  std::unique_ptr<StagedBlob> staged_;
  std::optional<Sha256Stream> part_digest_;  // where it is not that of the whole file
  int64_t received_bytes_ = 0;
};

// Files of scenes that arrive in parts, each with its digest, over any number of connections and restarts. A byte is
// written once, where the blob store can take it over, and hashed while it comes; parts have a digest of their own,
// which hashes it a second time. How far each file is stands in a folder of its own. Thread-safe.
class SceneUploads {
 public:
  // Makes the folder when it is not there.
  static absl::StatusOr<std::unique_ptr<SceneUploads>> Open(const std::string& folder, ReconstructionService& service);

  // Errors of it and of its parts, beside those of the reconstruction: InvalidArgument for fields; Aborted when the
  // part begins elsewhere than the one before ended, says other bytes than those that are there, or comes at the same
  // time as another one; HTTP status 422 for digests. ExpectedOffsetOf() tells where to go on. It outlives its parts.
  absl::StatusOr<std::unique_ptr<ScenePartUpload>> Begin(const std::string& id, const SceneFilePart& part);
  absl::StatusOr<SceneFileState> Get(const std::string& id, const std::string& path) const;
  // Those begun here and those that the reconstruction has, by path; none once it was started.
  absl::StatusOr<std::vector<SceneFileState>> List(const std::string& id) const;
  // Removes what belongs to reconstructions that take no files any more, and bytes that nobody added to for a week.
  void Sweep() const;

 private:
  friend class ScenePartUpload;
  SceneUploads(std::string folder, ReconstructionService& service) : folder_(std::move(folder)), service_(service) {}

  absl::Status CheckTakesFiles(const std::string& id) const;
  std::string StatePath(const std::string& id, const std::string& path) const;
  std::string StagedPath(const SceneFileState& state) const;
  absl::Status Save(const std::string& id, const SceneFileState& state) const;
  bool HasTaken(const std::string& id, const SceneFileState& state) const;
  absl::StatusOr<std::unique_ptr<StagedBlob>> Stage(const std::string& state_path, SceneFileState& state);
  void Remember(const std::string& state_path, const Sha256Stream& digest);
  void Forget(const std::string& state_path);
  void RemoveFolder(const std::string& id) const;
  void RemoveExpired() const;

  const std::string folder_;
  ReconstructionService& service_;
  Mutex mutex_;
  std::set<std::string> busy_ ABSL_GUARDED_BY(mutex_);  // state paths of the files that a part arrives for
  // By state path: the digest so far of files that are not complete, so that nobody has to read them again.
  std::map<std::string, Sha256Stream> digests_ ABSL_GUARDED_BY(mutex_);
};

// Where a file that an error is about should go on, if that is known.
std::optional<int64_t> ExpectedOffsetOf(const absl::Status& status);

}  // namespace meshwright
