#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "common/base/clock.h"
#include "common/base/thread_pool.h"
#include "common/blob/blob_store.h"
#include "common/scene/scene.h"
#include "coordinator/api/method.h"
#include "coordinator/api/reconstruction_record.h"
#include "coordinator/api/worker_logic.h"
#include "coordinator/conductor/conductor.h"
#include "coordinator/store/job_store.h"

namespace meshwright {

struct RetryOptions {
  int max_failures = 3;  // a camera whose job failed so often is set aside, >= 1
  // Losing workers says little about the camera; but one that takes every worker down must end too. >= 1
  int max_losses = 30;
  absl::Duration backoff = absl::Seconds(1);  // before the second attempt; doubles with each
  absl::Duration max_backoff = absl::Minutes(1);
};

// What all reconstructions of a coordinator share. Everything outlives them.
struct ConductingEnvironment {
  JobStore* store = nullptr;
  BlobStore* blobs = nullptr;
  const Clock* clock = nullptr;
  ThreadPool* pool = nullptr;  // acceptance and joining
  WorkerLogic* workers = nullptr;
  ParseMethod parse_method;
  RetryOptions retry;
};

// One reconstruction from its scene to its mesh, on a thread of its own, so that acceptance and joining keep nobody
// waiting. What it knows is in the JobStore; it may end at any moment and another one goes on.
class ConductedReconstruction {
 public:
  // Changes the record and makes the change durable. False: it was cancelled or deleted meanwhile, stop.
  using Update = std::function<absl::StatusOr<bool>(const std::function<void(ReconstructionRecord&)>& change)>;

  // `scene_folder`: where the scene is when record.scene_blob is "". `changed` is called when snapshot() may have.
  ConductedReconstruction(const ConductingEnvironment& environment, const ReconstructionRecord& record,
                          std::string scene_folder, std::string mesh_path, Update update,
                          std::function<void()> changed);
  // Ends after what it is doing at the moment.
  ~ConductedReconstruction();

  void RequestStop();

  struct Snapshot {
    Progress progress;
    std::vector<std::pair<CameraIndex, CameraIndex>> pairs;  // (reference, target) of the jobs handed out so far
  };
  Snapshot snapshot() const;

 private:
  struct Attempts {
    int failures = 0;
    int losses = 0;
  };

  void Run();
  absl::Status Conduct();
  absl::Status PrepareScene(const Method& method);
  absl::Status RunJobs(const Method& method, Conductor& conductor);
  void OfferJobs(const Method& method, Conductor& conductor);
  absl::Status Handle(const Method& method, Conductor& conductor, const JobOutcome& outcome);
  absl::Status TryAgain(const Method& method, const JobOutcome& outcome, absl::Duration delay);
  absl::Status Join(const Method& method, const Conductor& conductor);
  absl::Status Change(const std::function<void(ReconstructionRecord&)>& change);
  bool WaitForOutcome(JobOutcome& outcome);
  void PublishProgress(const Conductor& conductor);

  const ConductingEnvironment environment_;
  ReconstructionRecord record_;
  const std::string scene_folder_;
  const std::string mesh_path_;
  const Update update_;
  const std::function<void()> changed_;

  // Of the thread alone.
  std::vector<Camera> cameras_;
  std::vector<SparsePoint> points_;
  std::map<SequenceNumber, CameraJobSpec> handed_out_;
  std::map<SequenceNumber, Attempts> attempts_;

  mutable std::mutex mutex_;
  std::condition_variable wake_;
  std::deque<JobOutcome> outcomes_;
  bool stopping_ = false;
  Snapshot snapshot_;
  std::thread thread_;
};

}  // namespace meshwright
