#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <absl/time/time.h>

#include "common/base/ids.h"

namespace meshwright {

enum class ReconstructionState { kRunning, kDone };

struct Reconstruction {
  std::string id;
  std::string options_json;  // everything beside the scene that the result depends on
  std::string scene_digest;  // SHA-256, 64 hexadecimal digits
  ReconstructionState state = ReconstructionState::kRunning;
};

// The life of a camera job: assigned -> done -> committed, or assigned -> set aside -> committed (with no surface).
// Jobs get done in any order; they are committed in the order of their sequence numbers.
enum class CameraJobState { kAssigned, kDone, kSetAside };

struct CameraJob {
  SequenceNumber sequence = 0;
  CameraIndex camera = 0;
  SequenceNumber snapshot = 0;  // the commit whose accepted surfaces the job sees
  CameraJobState state = CameraJobState::kAssigned;
  // Grows whenever the job is handed out again. Every write names the epoch it was handed out with, so that somebody
  // who was given up on (a worker cut off, a process from before a restart) cannot write any more.
  int64_t epoch = 1;
  std::string filtered_digest;            // F_r in the BlobStore; set when done
  std::vector<CameraIndex> weak_targets;  // pairs (camera, target) to be removed from the incidence matrix
  std::string report_json;                // what the worker says about the job; set when done
  std::string set_aside_reason;
};

// One line of the only order that counts. Number s exists only when 1 .. s - 1 exist.
struct Commit {
  SequenceNumber sequence = 0;
  CameraIndex camera = 0;
  std::string accepted_digest;  // M_r in the BlobStore; empty when nothing was accepted
  int64_t filtered_patches = 0;
  int64_t accepted_patches = 0;

  bool operator==(const Commit&) const = default;
};

// The memory of reconstructions: what must survive when a process dies. Each method is one durable transaction: when it
// returns OK the change is on disk, otherwise nothing has changed. Thread-safe. Time comes as a parameter.
//
// Errors: NotFound (no such reconstruction or job), AlreadyExists, Aborted (the epoch is an old one: drop the job),
// FailedPrecondition (out of order, or contradicts what is stored), DataLoss (not a store, or damaged),
// ResourceExhausted (disk full), Unavailable (held by another process).
class JobStore {
 public:
  virtual ~JobStore() = default;

  virtual absl::Status CreateReconstruction(const Reconstruction& reconstruction, absl::Time now) = 0;
  virtual absl::StatusOr<Reconstruction> GetReconstruction(const std::string& id) = 0;
  virtual absl::StatusOr<std::vector<Reconstruction>> ListReconstructions() = 0;  // by id
  virtual absl::Status SetReconstructionState(const std::string& id, ReconstructionState state) = 0;

  // Writes down that a camera was chosen, with epoch 1. Again with the same camera and snapshot: OK, nothing changes.
  virtual absl::Status AssignCameraJob(const std::string& id, SequenceNumber sequence, CameraIndex camera,
                                       SequenceNumber snapshot, absl::Time now) = 0;
  // Hands an assigned job out again: its epoch grows by one and is returned.
  virtual absl::StatusOr<int64_t> ReassignCameraJob(const std::string& id, SequenceNumber sequence, absl::Time now) = 0;
  // The job's result; the blob must be durable already. Repeating it with the same digest is OK.
  virtual absl::Status CompleteCameraJob(const std::string& id, SequenceNumber sequence, int64_t epoch,
                                         const std::string& filtered_digest,
                                         const std::vector<CameraIndex>& weak_targets, const std::string& report_json,
                                         absl::Time now) = 0;
  // Gives the job up with a reason. Repeating it is OK; the first reason stays.
  virtual absl::Status SetCameraJobAside(const std::string& id, SequenceNumber sequence, int64_t epoch,
                                         const std::string& reason, absl::Time now) = 0;
  virtual absl::StatusOr<std::vector<CameraJob>> ListCameraJobs(const std::string& id) = 0;  // by sequence

  // Adds commit number `commit.sequence`, which must be the next one, of a job that is done or set aside. The accepted
  // surface must be durable already. Repeating the same commit is OK.
  virtual absl::Status AddCommit(const std::string& id, const Commit& commit, absl::Time now) = 0;
  virtual absl::StatusOr<std::vector<Commit>> ListCommits(const std::string& id) = 0;  // by sequence
};

// How weak targets stand in the store: numbers with commas between them, "" for none.
std::string JoinCameraIndices(const std::vector<CameraIndex>& cameras);
absl::StatusOr<std::vector<CameraIndex>> SplitCameraIndices(const std::string& text);

}  // namespace meshwright
