// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "meshwright/v1/reconstruction.pb.h"

#include "common/base/method_version.h"
#include "common/base/mutex.h"
#include "coordinator/api/reconstruction_record.h"
#include "coordinator/api/scene_upload.h"
#include "coordinator/conductor/reconstruction_driver.h"
#include "coordinator/dispatch/worker_service.h"
#include "coordinator/store/store_news.h"

namespace meshwright {

struct ReconstructionServiceOptions {
  std::string data_folder;               // uploads on their way, copies of meshes
  std::vector<std::string> scene_roots;  // folders that scenes may be taken from by reference
  // Names this coordinator among those that share the store: the same when it is started anew, so that it takes back
  // what it conducted at once.
  std::string name = "coordinator";
  // Another coordinator takes over what this one conducts when it has been silent so long.
  absl::Duration conductor_lease = absl::Seconds(5);
  // What was begun with another version of the method is left to coordinators that have it.
  int64_t method_version = kMethodVersion;
  // Told of each reconstruction that has come to its end here, once; not of one whose end this process did not live to
  // see. Must not block.
  std::function<void(const v1::Reconstruction&)> ended = [](const v1::Reconstruction&) {};
  // For the other coordinators that share the store. Must not block.
  std::function<void(const StoreNews&)> tell_others = [](const StoreNews&) {};
};

// The public interface without a network. All that it knows is in the JobStore and the BlobStore, so any coordinator
// answers any call; a thread takes up reconstructions that nobody conducts. Thread-safe. Errors are as
// reconstruction.proto says.
class ReconstructionService {
 public:
  static absl::StatusOr<std::unique_ptr<ReconstructionService>> Open(const ReconstructionServiceOptions& options,
                                                                     const DriverEnvironment& environment,
                                                                     WorkerService& workers);
  // Ends all of them after what they are doing at the moment.
  ~ReconstructionService();

  // `owner`: whose it is; "": nobody's in particular.
  absl::StatusOr<v1::Reconstruction> Create(const v1::CreateReconstructionRequest& request,
                                            const std::string& owner = "");
  // Creates one of the files that were uploaded for `source`, whatever has become of that, or of the same
  // scene_reference, so that `request` names none: with other options nothing has to be sent again. Repeating it is
  // harmless.
  absl::StatusOr<v1::Reconstruction> CreateAgain(const std::string& source, v1::CreateReconstructionRequest request,
                                                 const std::string& owner = "");
  absl::StatusOr<SceneFileUpload> BeginUpload(const v1::UploadSceneFileRequest::Header& header);
  // The same for a file that has come otherwise and lies, synced and with the digest that it should have, in
  // staging_folder(), or elsewhere where it has to be copied. It is gone when this returns OK.
  absl::Status AdoptSceneFile(const std::string& id, const SceneFile& file, const std::string& staged_path);
  std::string staging_folder() const;
  // What has been uploaded so far, by path.
  absl::StatusOr<std::vector<SceneFile>> ListSceneFiles(const std::string& id) const;
  absl::StatusOr<v1::Reconstruction> Start(const std::string& id);
  absl::StatusOr<v1::Reconstruction> Get(const std::string& id) const;
  // Of this owner alone, if one is named.
  absl::StatusOr<v1::ListReconstructionsResponse> List(const v1::ListReconstructionsRequest& request,
                                                       const std::optional<std::string>& owner = std::nullopt) const;
  absl::StatusOr<v1::Reconstruction> Cancel(const std::string& id);
  absl::Status Delete(const std::string& id);
  absl::StatusOr<v1::ListCamerasResponse> ListCameras(const std::string& id) const;
  // As it was taken: image_path of each view is the digest of its photograph's blob. FailedPrecondition before it was
  // checked.
  absl::StatusOr<Scene> LoadScene(const std::string& id) const;
  absl::StatusOr<v1::GetIncidenceResponse> GetIncidence(const std::string& id) const;
  // Those with a sequence greater than `after`.
  // Scene::offset; 0 before the scene was taken.
  absl::StatusOr<Eigen::Vector3d> OffsetOf(const std::string& id) const;
  absl::StatusOr<v1::ListPartsResponse> ListParts(const std::string& id, SequenceNumber after = 0) const;
  absl::StatusOr<v1::Part> GetPart(const std::string& id, SequenceNumber sequence) const;
  absl::StatusOr<v1::ListAttemptsResponse> ListAttempts(const v1::ListAttemptsRequest& request) const;
  // The file to be read: this coordinator's copy of the mesh, there as long as the reconstruction is not deleted.
  absl::StatusOr<std::string> MeshPath(const std::string& id) const;
  absl::StatusOr<std::string> PartBytes(const std::string& id, SequenceNumber sequence) const;

  // Calls `send` with what it is and again when it has changed, until it is over, `send` gives false, `cancelled`,
  // which is asked every half second, gives true, or Shutdown().
  absl::Status Watch(const std::string& id, const std::function<bool()>& cancelled,
                     const std::function<bool(const v1::Reconstruction&)>& send);
  // What another coordinator tells.
  void Hear(const StoreNews& news);
  // Ends all Watch().
  void Shutdown();

 private:
  ReconstructionService(const ReconstructionServiceOptions& options, const DriverEnvironment& environment,
                        WorkerService& workers);

  absl::StatusOr<Reconstruction> Find(const std::string& id) const;
  v1::Reconstruction Describe(const Reconstruction& reconstruction) const;
  absl::Status CheckTakesFiles(const std::string& id) const;
  bool WakeConductor(const std::string& id);  // false: it is none of this coordinator's
  void StopConducting(const std::string& id);
  void TellEnd(const std::string& id);
  void Changed(bool look);
  void Oversee();
  absl::Status OverseeOnce();
  absl::Status TakeUp(const ConductedState& state, absl::Time now);
  // Somebody else's lease has not been renewed for its length, by the monotonic clock.
  bool IsAbandoned(const ConductedState& state);

  const ReconstructionServiceOptions options_;
  const CoordinatorFolders folders_;
  const DriverEnvironment environment_;
  WorkerService& workers_;
  mutable Mutex mutex_;
  mutable std::map<std::string, Eigen::Vector3d> offsets_ ABSL_GUARDED_BY(mutex_);  // of scenes that were looked at
  mutable ConditionVariable changed_;
  int64_t version_ ABSL_GUARDED_BY(mutex_) = 0;  // grows when something may have changed
  std::map<std::string, std::unique_ptr<ReconstructionDriver>> conducted_ ABSL_GUARDED_BY(mutex_);  // here
  bool look_ ABSL_GUARDED_BY(mutex_) = false;  // the overseer should look now
  bool stopping_ ABSL_GUARDED_BY(mutex_) = false;
  ConditionVariable overseer_wake_;
  // Of the overseer alone: leases as they stood, and since when.
  struct SeenLease {
    int64_t epoch = 0;
    absl::Time expires_at;
    absl::Duration since;  // by Clock::Uptime()
  };
  std::map<std::string, SeenLease> others_;
  std::thread overseer_;
};

// Whether nothing will change any more.
bool IsOver(v1::ReconstructionState state);

}  // namespace meshwright
