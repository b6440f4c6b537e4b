#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <absl/types/span.h>

#include "coordinator/api/reconstruction_service.h"

namespace meshwright {

// How far the upload of a scene's file is.
struct SceneFileState {
  std::string path;
  int64_t size_bytes = 0;
  std::string sha256;
  int64_t offset_bytes = 0;  // that are there
  bool complete = false;     // the reconstruction has it
};

// One part of a file: bytes [offset_bytes, offset_bytes + its length).
struct SceneFilePart {
  std::string path;
  int64_t size_bytes = 0;  // of the whole file
  std::string sha256;      // of the whole file
  int64_t offset_bytes = 0;
  std::string part_sha256;  // "" when the part is the whole file
};

// Files of scenes that arrive in parts, each with its digest, over any number of connections and restarts. What is
// incomplete lies in a folder of its own; a complete file goes to the reconstruction as any other upload does.
// Thread-safe.
class SceneUploads {
 public:
  using Take = std::function<absl::Status(absl::Span<const uint8_t>)>;
  // Hands over the part's bytes in pieces; errors of `take` are released.
  using Read = std::function<absl::Status(const Take& take)>;

  // Makes the folder when it is not there.
  static absl::StatusOr<std::unique_ptr<SceneUploads>> Open(const std::string& folder, ReconstructionService& service);

  // Errors beside those of `read` and of the reconstruction: InvalidArgument for fields; Aborted when the part begins
  // elsewhere than the one before ended, says other bytes than those that are there, or comes at the same time as
  // another one, `*expected_offset` then says where to go on; HTTP status 422 for digests.
  absl::StatusOr<SceneFileState> Put(const std::string& id, const SceneFilePart& part, const Read& read,
                                     int64_t* expected_offset);
  absl::StatusOr<SceneFileState> Get(const std::string& id, const std::string& path) const;
  // Those begun here and those that the reconstruction has, by path; none once it was started.
  absl::StatusOr<std::vector<SceneFileState>> List(const std::string& id) const;
  // Removes what belongs to reconstructions that take no files any more.
  void Sweep() const;

 private:
  SceneUploads(std::string folder, ReconstructionService& service) : folder_(std::move(folder)), service_(service) {}

  absl::Status CheckTakesFiles(const std::string& id) const;
  std::string StatePath(const std::string& id, const std::string& path) const;
  absl::Status Save(const std::string& id, const SceneFileState& state) const;
  bool HasTaken(const std::string& id, const SceneFileState& state) const;
  absl::Status Deliver(const std::string& id, const SceneFileState& state) const;

  const std::string folder_;
  ReconstructionService& service_;
  std::mutex mutex_;
  std::set<std::string> busy_;  // state paths of the files that a part arrives for
};

}  // namespace meshwright
