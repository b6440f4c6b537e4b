// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "common/base/clock.h"
#include "common/base/mutex.h"
#include "common/blob/staged_blob.h"
#include "coordinator/api/reconstruction_service.h"
#include "coordinator/auth/gatekeeper.h"
#include "coordinator/nodeodm/odm_options.h"
#include "coordinator/nodeodm/odm_task.h"
#include "coordinator/nodeodm/result_package.h"
#include "coordinator/nodeodm/zip_archive.h"

namespace meshwright {

// What a client says when it begins a task.
struct NewOdmTask {
  std::string uuid;  // "": one is drawn
  std::string name;
  std::string options;  // JSON text
  std::vector<std::string> outputs;
  std::string webhook;
  int64_t created_ms = 0;  // 0: now
};

// The tasks of NodeODM's protocol, each over a reconstruction of the service. What is asked of a task is answered from
// memory, whatever the store does; a thread follows the reconstructions, and another one makes what clients download.
// Tasks are kept in a folder of this coordinator, and only it knows them. Thread-safe.
//
// Errors: NotFound ("Invalid uuid (not found)" and the like), InvalidArgument, FailedPrecondition: repeating does not
// help; all others: it may.
class TaskBoard {
 public:
  struct Services {
    ReconstructionService* reconstructions = nullptr;
    Gatekeeper* gate = nullptr;
    BlobStore* blobs = nullptr;
    const OdmOptions* options = nullptr;
    const Clock* clock = nullptr;
    WriteTexturedGlb write_textured_glb;
    std::function<bool()> can_estimate_cameras;  // whether a worker with COLMAP is there
    int max_images = 0;                          // of a task; 0: any number
    std::function<void(const std::string&)> warn;
  };

  // Makes the folder when it is not there. `services` outlive it.
  static absl::StatusOr<std::unique_ptr<TaskBoard>> Open(const std::string& folder, const Services& services);
  ~TaskBoard();

  // The caller's own, if that is within the quota of reconstructions. Returns the UUID.
  absl::StatusOr<std::string> Begin(const Caller& caller, const NewOdmTask& task);
  // Whose it is, committed or not.
  absl::StatusOr<std::string> OwnerOf(const std::string& uuid) const;
  // Whether files may be sent to it. NotFound otherwise.
  absl::Status CheckTakesFiles(const std::string& uuid) const;
  // A file among its images, whole, which is taken away. The same bytes under the same name are the same file; other
  // bytes get a new name.
  absl::Status TakeFile(const std::string& uuid, const std::string& file_name, StagedBlob& file);
  std::string staging_folder() const { return services_.reconstructions->staging_folder(); }
  // No more files: it is a task from now on. Repeating it is harmless.
  absl::Status Commit(const std::string& uuid);

  std::vector<std::string> List(const Caller& caller) const;  // that it may see, of those committed; the oldest first
  absl::StatusOr<OdmTask> Get(const std::string& uuid) const;
  // Lines from number `line` on.
  absl::StatusOr<std::vector<std::string>> Output(const std::string& uuid, size_t line) const;
  absl::StatusOr<std::vector<std::string>> Images(const std::string& uuid) const;
  int64_t now_ms() const;
  int queued_or_running() const;

  // What has ended stays as it is.
  absl::Status Cancel(const std::string& uuid);
  absl::Status Remove(const std::string& uuid);
  // `options`: JSON text; none: as before. FailedPrecondition while it runs.
  absl::Status Restart(const std::string& uuid, const std::optional<std::string>& options);
  // FailedPrecondition until it is completed.
  absl::StatusOr<std::shared_ptr<const ZipArchive>> Archive(const std::string& uuid) const;

 private:
  struct Entry {
    OdmTask task;
    std::vector<std::string> output;
    std::map<std::string, std::string> files;  // name -> digest, of those that are there or on their way
    std::set<std::string> unused_files;
    bool knows_files = false;  // not yet when it was read from its file
  };
  using Change = std::function<void(OdmTask& task, std::vector<std::string>& lines)>;

  TaskBoard(std::string folder, const Services& services) : folder_(std::move(folder)), services_(services) {}

  absl::Status Load();
  std::string PathOf(const std::string& uuid, const char* ending) const;
  std::string ResultFolder(const std::string& uuid) const;
  // Changes the task and its output in memory and on disk. NotFound when it is gone.
  absl::Status Update(const std::string& uuid, const Change& change);
  absl::Status LearnFiles(const std::string& uuid);
  absl::StatusOr<OdmTask> Find(const std::string& uuid) const;  // committed or not

  void Follow();
  void FollowOnce();
  void Look(const OdmTask& task);
  absl::Status StartRun(const OdmTask& task);
  absl::Status Again(const OdmTask& from, OdmTask& to, const OdmTaskOptions& options);
  void TellStage(const OdmTask& task, const std::string& stage);
  void Progress(const OdmTask& task, const v1::Reconstruction& reconstruction);
  void End(const OdmTask& task, OdmStatus status, const std::string& error);
  void Pack();
  void PackOne(const OdmTask& task);

  const std::string folder_;
  const Services services_;
  Mutex disk_mutex_;  // before mutex_: changes come to the disk in their order
  mutable Mutex mutex_;
  ConditionVariable wake_;  // for both threads
  std::map<std::string, Entry> tasks_ ABSL_GUARDED_BY(mutex_);
  std::deque<std::string> to_pack_ ABSL_GUARDED_BY(mutex_);
  bool has_news_ ABSL_GUARDED_BY(mutex_) = false;
  bool stopping_ ABSL_GUARDED_BY(mutex_) = false;
  std::thread follower_;
  std::thread packer_;
};

}  // namespace meshwright
