#pragma once

#include <condition_variable>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "meshwright/v1/reconstruction.pb.h"

#include "coordinator/api/conducted_reconstruction.h"
#include "coordinator/api/scene_intake.h"

namespace meshwright {

struct ReconstructionLogicOptions {
  std::string data_folder;               // records, uploads and meshes
  std::vector<std::string> scene_roots;  // folders that scenes may be taken from by reference
};

// The public interface without a network. Thread-safe. Errors are as reconstruction.proto says.
class ReconstructionLogic {
 public:
  // Goes on with every reconstruction that was not finished.
  static absl::StatusOr<std::unique_ptr<ReconstructionLogic>> Open(const ReconstructionLogicOptions& options,
                                                                   const ConductingEnvironment& environment);
  // Ends all of them after what they are doing at the moment.
  ~ReconstructionLogic();

  absl::StatusOr<v1::Reconstruction> Create(const v1::CreateReconstructionRequest& request);
  absl::StatusOr<SceneFileUpload> BeginUpload(const v1::UploadSceneFileRequest::Header& header);
  absl::StatusOr<v1::Reconstruction> Start(const std::string& id);
  absl::StatusOr<v1::Reconstruction> Get(const std::string& id) const;
  absl::StatusOr<v1::ListReconstructionsResponse> List(const v1::ListReconstructionsRequest& request) const;
  absl::StatusOr<v1::Reconstruction> Cancel(const std::string& id);
  absl::Status Delete(const std::string& id);
  absl::StatusOr<v1::ListCamerasResponse> ListCameras(const std::string& id) const;
  // As it was taken: image_path of each view is the digest of its photograph's blob. FailedPrecondition before it was
  // checked.
  absl::StatusOr<Scene> LoadScene(const std::string& id) const;
  absl::StatusOr<v1::GetIncidenceResponse> GetIncidence(const std::string& id) const;
  absl::StatusOr<v1::ListPartsResponse> ListParts(const std::string& id) const;
  // The file to be read, there as long as the reconstruction is not deleted.
  absl::StatusOr<std::string> MeshPath(const std::string& id) const;
  absl::StatusOr<std::string> PartBytes(const std::string& id, int32_t sequence) const;

  // Calls `send` with what it is and again when it has changed, until it is over, `send` gives false or Shutdown().
  absl::Status Watch(const std::string& id, const std::function<bool(const v1::Reconstruction&)>& send);
  // Ends all Watch().
  void Shutdown();

 private:
  struct Entry {
    ReconstructionRecord record;
    std::unique_ptr<ConductedReconstruction> conducted;  // null when it does not run
    int64_t version = 0;
  };

  ReconstructionLogic(const ReconstructionLogicOptions& options, const ConductingEnvironment& environment,
                      RecordFolder records);

  absl::StatusOr<Entry*> Find(const std::string& id) const;  // needs the lock
  v1::Reconstruction ToProto(const Entry& entry) const;
  void Conduct(Entry& entry);
  absl::StatusOr<bool> Update(const std::string& id, const std::function<void(ReconstructionRecord&)>& change);
  absl::Status StopEntry(Entry& entry, const std::function<void(ReconstructionRecord&)>& change);
  std::string UploadFolder(const std::string& id) const;
  std::string MeshFile(const std::string& id) const;
  void Touch(const std::string& id);

  const ReconstructionLogicOptions options_;
  const ConductingEnvironment environment_;
  const RecordFolder records_;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  mutable std::map<std::string, Entry> entries_;
  bool stopping_ = false;
};

// Whether nothing will change any more.
bool IsOver(v1::ReconstructionState state);

}  // namespace meshwright
