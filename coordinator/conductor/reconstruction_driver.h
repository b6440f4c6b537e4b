// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "common/base/clock.h"
#include "common/base/mutex.h"
#include "common/base/thread_pool.h"
#include "common/blob/blob_store.h"
#include "common/scene/scene.h"
#include "coordinator/conductor/conductor_lease.h"
#include "coordinator/conductor/final_surfaces.h"
#include "coordinator/conductor/joining_progress.h"
#include "coordinator/conductor/outer_loop.h"
#include "coordinator/conductor/reconstruction_config.h"
#include "coordinator/conductor/referenced_blobs.h"
#include "coordinator/conductor/scene_ingestion.h"
#include "coordinator/store/job_store.h"

namespace meshwright {

// A photograph of a folder without cameras, or a mask of one.
struct PhotographFile {
  std::string path;  // relative to the folder
  std::string local_path;
};
// None: there are no photographs. Errors are bad input: too few of them, or of kinds that are not read.
using PhotographLister = std::function<absl::StatusOr<std::vector<PhotographFile>>(const std::string& folder)>;

// What a reconstruction came to, as JSON that is kept with its mesh.
using VerdictMaker =
    std::function<absl::StatusOr<std::string>(const std::string& id, const std::vector<JudgedCamera>& judged)>;

// What all reconstructions of a coordinator share. Everything outlives them.
struct DriverEnvironment {
  JobStore* store = nullptr;
  BlobStore* blobs = nullptr;
  const Clock* clock = nullptr;
  ThreadPool* pool = nullptr;          // acceptance and joining
  std::function<void()> jobs_changed;  // there may be new jobs in the store
  ParseReconstructionConfig parse_config;
  PhotographLister list_photographs;
  VerdictMaker make_verdict;
  int max_failures = 3;  // a camera whose job failed so often is skipped, >= 1
};

// Where a coordinator finds and puts files.
struct CoordinatorFolders {
  std::string data;                      // uploads on their way, and copies of meshes
  std::vector<std::string> scene_roots;  // folders that scenes may be taken from by reference

  std::string MeshFile(const std::string& digest) const { return data + "/meshes/" + digest + ".ply"; }
};

// One reconstruction from its scene to its mesh, or to its end when it is being deleted, on a thread of its own, so
// that acceptance and joining keep nobody waiting. What it knows is in the JobStore, and what it writes there is fenced
// by the epoch of its lease: it may end at any moment and another one goes on, here or elsewhere.
class ReconstructionDriver {
 public:
  // `lease`: of its conductor, which the owner renews and releases. `is_deleting`: to be deleted, not conducted.
  // `changed` is called when what the store says of it may have changed.
  ReconstructionDriver(const DriverEnvironment& environment, const CoordinatorFolders& folders, std::string id,
                       HeldConductorLease lease, bool is_deleting, std::function<void(bool has_ended)> changed);
  // Ends after what it is doing at the moment.
  ~ReconstructionDriver();

  void RequestStop();
  // There may be results in the store.
  void Wake();
  // It has nothing to do any more, for whatever reason; its lease can go.
  bool has_ended() const { return has_ended_; }
  HeldConductorLease& lease() { return lease_; }
  bool is_deleting() const { return is_deleting_; }

 private:
  void Run();
  absl::Status ConductOrFail();
  absl::Status Conduct();
  absl::Status DeleteEverything();
  absl::Status PrepareScene(const ReconstructionConfig& config);
  // Nothing: the cameras of its photographs are being estimated.
  absl::StatusOr<std::optional<IngestedScene>> Take();
  absl::StatusOr<std::optional<Scene>> ReadOrEstimate(const std::string& folder);
  absl::Status RequestEstimation(const std::vector<PhotographFile>& photographs);
  // Until the job that prepares the scene has ended, if there is one.
  absl::Status WaitFor(SequenceNumber preparation);
  // Has a worker look whether the cameras agree with the photographs.
  absl::Status RequestRefinement(const std::string& given_scene_blob);
  // The blob of the scene with the cameras that came out of it; the given one where they stay. Nothing yet: a worker is
  // at it, also for a second time when what came out is lost.
  absl::StatusOr<std::optional<std::string>> RefinedSceneBlob(const std::string& given_scene_blob);
  absl::StatusOr<std::string> WaitForRefinedSceneBlob(const std::string& given_scene_blob);
  struct SceneFolder {
    std::string path;
    bool is_temporary = false;  // made for this, and to be removed
  };
  absl::StatusOr<SceneFolder> FindSceneFolder();
  absl::StatusOr<std::unique_ptr<OuterLoop>> OpenLoop(const ReconstructionConfig& config);
  absl::Status RunJobs(OuterLoop& loop);
  absl::Status Join(const ReconstructionConfig& config, OuterLoop& loop);
  // `judged` gets what the mesh is made of.
  absl::StatusOr<JoinedMeshCounts> TryToWriteMesh(const ReconstructionConfig& config, const Conductor& conductor,
                                                  const std::string& path, JudgedSurfaces& judged);
  std::string MakeVerdict(const JudgedSurfaces& judged) const;
  void TellJoining(const JoiningProgress& joining, const Conductor& conductor);
  absl::StatusOr<StoredMesh> WriteMesh(const ReconstructionConfig& config, OuterLoop& loop);
  absl::Status Repair(OuterLoop& loop, const std::string& digest);
  absl::StatusOr<bool> RepairScene(const std::string& digest);
  absl::Status SetState(ReconstructionState state, const std::string& reason = "");
  bool WaitForNews();
  bool WaitToRetry();

  const DriverEnvironment environment_;
  const CoordinatorFolders folders_;
  const std::string id_;
  HeldConductorLease lease_;  // the owner's
  const int64_t epoch_;
  const bool is_deleting_;
  const std::function<void(bool has_ended)> changed_;

  // Of the thread alone.
  Reconstruction record_;
  ReferencedBlobs referenced_blobs_;
  std::vector<Camera> cameras_;
  std::vector<SparsePoint> points_;
  Eigen::Vector3d offset_ = Eigen::Vector3d::Zero();  // of the scene
  std::map<std::string, std::string> photographs_;    // digest -> name

  std::atomic<bool> has_ended_{false};
  Mutex mutex_;
  ConditionVariable wake_;
  bool has_news_ ABSL_GUARDED_BY(mutex_) = false;
  bool stopping_ ABSL_GUARDED_BY(mutex_) = false;
  std::thread thread_;
};

}  // namespace meshwright
