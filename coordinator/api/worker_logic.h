#pragma once

#include <condition_variable>
#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "meshwright/v1/reconstruction.pb.h"
#include "meshwright/v1/worker.pb.h"

#include "common/base/clock.h"
#include "coordinator/api/lease_book.h"

namespace meshwright {

// How a lease ended.
struct JobOutcome {
  enum class Kind {
    kFinished,
    kFailed,     // the worker says so, or it took too long
    kLost,       // the worker is silent, or was started anew
    kGivenBack,  // not the job's fault
  };
  Kind kind = Kind::kFinished;
  SequenceNumber sequence = 0;
  int64_t epoch = 0;
  std::string filtered_digest;  // kFinished
  std::vector<CameraIndex> weak_targets;
  std::string report_json;
  std::string reason;  // otherwise
};

// What workers are told about a reconstruction beside its jobs.
struct LeasedReconstruction {
  double weight = 1;
  std::string options_json;
  std::string scene_digest;  // of the blob that EncodeScene made
  // Called with the lock held: only notes the outcome somewhere. Every lease that is not removed with its
  // reconstruction ends with exactly one.
  std::function<void(JobOutcome)> sink;
};

// The coordinator's side of the worker protocol, without a network. Thread-safe; nothing here waits for acceptance, the
// store or the blobs.
class WorkerLogic {
 public:
  WorkerLogic(const LeaseOptions& options, const Clock& clock);

  void AddReconstruction(const std::string& id, LeasedReconstruction reconstruction);
  void RemoveReconstruction(const std::string& id);
  void Offer(const std::string& id, CameraJobSpec spec, int64_t memory_bytes, absl::Time not_before);
  int LeasesIn(const std::string& id) const;

  // Waits up to request.patience_seconds while there is nothing that the worker does not know; `cancelled` is asked now
  // and then. InvalidArgument names the field.
  absl::StatusOr<v1::SynchronizeResponse> Synchronize(const v1::SynchronizeRequest& request,
                                                      const std::function<bool()>& cancelled);
  // To be called every now and then, at least once in the time of a lease.
  void ExpireLeases();
  v1::ListWorkersResponse ListWorkers() const;
  // Everybody who waits gets an answer now.
  void Shutdown();

 private:
  void Settle(const std::string& worker, const v1::HeldJob& held);
  void Tell(const LeaseBook::Lease& lease, JobOutcome::Kind kind, std::string reason);
  v1::SynchronizeResponse Answer(const std::string& worker) const;

  const LeaseOptions options_;
  const Clock& clock_;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  LeaseBook book_;
  std::map<std::string, LeasedReconstruction> reconstructions_;
  bool stopping_ = false;
};

}  // namespace meshwright
