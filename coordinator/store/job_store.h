#pragma once

#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <absl/time/time.h>

#include "common/base/ids.h"

namespace meshwright {

// created (its scene is still coming) -> running -> done, cancelled or failed; those three are final.
enum class ReconstructionState { kCreated, kRunning, kDone, kCancelled, kFailed };

struct Reconstruction {
  std::string id;
  std::string options_json;  // everything beside the scene that the result depends on
  std::string scene_digest;  // SHA-256, 64 hexadecimal digits; empty only before it runs
  ReconstructionState state = ReconstructionState::kRunning;
  std::string state_reason;  // why it was cancelled or failed
  int64_t weight = 1;        // its share of the workers, relative to the others'; at least 1
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

  int64_t memory_bytes = 0;  // what the job needs; 0 where nobody asks
  // Attempts that ended badly: the worker said so, or its lease ran out. Jobs that were given back do not count.
  int64_t failed_attempts = 0;
  int64_t out_of_memory_failures = 0;  // those of them that ran out of memory
  std::string last_failure;
  absl::Time not_before = absl::UnixEpoch();  // is not leased earlier (backoff)
  // The worker that holds it and until when; empty when nobody does, and always when the job is not assigned.
  std::string lease_worker;
  absl::Time lease_expires_at = absl::UnixEpoch();
};

// Asks for jobs that are assigned and that nobody holds (or no longer: a lease that ran out is taken over, which counts
// as a failed attempt), of reconstructions that are running.
struct LeaseRequest {
  std::string worker;
  // The reconstructions to take from, those whose turn it is first. Empty: all, the lowest sequence numbers first.
  std::vector<std::string> reconstruction_ids;
  int64_t memory_bytes = std::numeric_limits<int64_t>::max();  // only jobs that need at most this
  int64_t max_jobs = 1;
  absl::Time expires_at;
  absl::Time now;
};

// A camera that was chosen.
struct CameraAssignment {
  SequenceNumber sequence = 0;
  CameraIndex camera = 0;
  SequenceNumber snapshot = 0;
  int64_t memory_bytes = 0;
};

struct CameraLease {
  std::string reconstruction_id;
  CameraJob job;  // with the epoch, the worker and the expiry of the lease
};

struct CameraJobFailure {
  std::string reason;
  bool out_of_memory = false;
  absl::Time retry_at = absl::UnixEpoch();  // nobody gets the job earlier
};

// Who conducts a reconstruction: chooses its cameras and accepts its surfaces.
struct ConductorLease {
  std::string owner;
  int64_t epoch = 0;
  absl::Time expires_at = absl::UnixEpoch();
};

struct WorkerRecord {
  std::string id;
  int64_t cores = 0;
  int64_t memory_bytes = 0;
  absl::Time last_heartbeat = absl::UnixEpoch();
  bool drained = false;  // gets no more jobs
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
// returns OK the change is on disk, otherwise nothing has changed (Unavailable: or perhaps it has; every method may be
// repeated). Thread-safe. Time comes as a parameter; in a cluster it is Now(), the one clock that all have in common.
//
// Writes of a conductor carry its epoch (AcquireConductorLease); 0 stands for a store that only one process writes to.
//
// Errors: NotFound (no such reconstruction or job), AlreadyExists, Aborted (the epoch is an old one: drop the job, or
// the reconstruction), FailedPrecondition (out of order, or contradicts what is stored), InvalidArgument (a value that
// cannot be stored), DataLoss (not a store, or damaged), ResourceExhausted (disk full), PermissionDenied, Unavailable
// (held by another process, or the server cannot be reached).
class JobStore {
 public:
  virtual ~JobStore() = default;

  // The store's clock: the database's, or the process's where there is no server.
  virtual absl::StatusOr<absl::Time> Now() = 0;

  virtual absl::Status CreateReconstruction(const Reconstruction& reconstruction, absl::Time now) = 0;
  virtual absl::StatusOr<Reconstruction> GetReconstruction(const std::string& id) = 0;
  // By id, at most `limit` of those whose id is greater than `after`.
  virtual absl::StatusOr<std::vector<Reconstruction>> ListReconstructions(
      const std::string& after = "", int64_t limit = std::numeric_limits<int64_t>::max()) = 0;
  // Gives a reconstruction that is only created its scene. Repeating it is OK; FailedPrecondition once it runs.
  virtual absl::Status SetReconstructionScene(const std::string& id, const std::string& scene_digest) = 0;
  // FailedPrecondition when it has another final state already.
  virtual absl::Status SetReconstructionState(const std::string& id, ReconstructionState state,
                                              const std::string& reason = "", int64_t conductor_epoch = 0) = 0;
  // With its jobs and commits. Deleting what is not there is harmless.
  virtual absl::Status DeleteReconstruction(const std::string& id) = 0;

  // Writes down that a camera was chosen, with epoch 1. Again with the same camera and snapshot: OK, nothing changes.
  virtual absl::Status AssignCameraJob(const std::string& id, SequenceNumber sequence, CameraIndex camera,
                                       SequenceNumber snapshot, absl::Time now, int64_t conductor_epoch = 0,
                                       int64_t memory_bytes = 0) = 0;
  // Hands an assigned job out again without a lease: its epoch grows by one and is returned.
  virtual absl::StatusOr<int64_t> ReassignCameraJob(const std::string& id, SequenceNumber sequence, absl::Time now) = 0;
  // The job's result; the blob must be durable already. Repeating it with the same digest is OK. A lease that ran out
  // does not matter as long as nobody took the job over.
  virtual absl::Status CompleteCameraJob(const std::string& id, SequenceNumber sequence, int64_t epoch,
                                         const std::string& filtered_digest,
                                         const std::vector<CameraIndex>& weak_targets, const std::string& report_json,
                                         absl::Time now) = 0;
  // Gives the job up with a reason. Repeating it is OK; the first reason stays.
  virtual absl::Status SetCameraJobAside(const std::string& id, SequenceNumber sequence, int64_t epoch,
                                         const std::string& reason, absl::Time now) = 0;
  virtual absl::StatusOr<CameraJob> GetCameraJob(const std::string& id, SequenceNumber sequence) = 0;
  // By sequence, those with a number greater than `after`.
  virtual absl::StatusOr<std::vector<CameraJob>> ListCameraJobs(const std::string& id, SequenceNumber after = 0) = 0;

  // Leases at most `max_jobs` jobs; each one's epoch grows by one. Two callers never get the same job, and neither
  // waits for the other. In the order of the request's reconstructions, then of the sequence numbers.
  virtual absl::StatusOr<std::vector<CameraLease>> LeaseCameraJobs(const LeaseRequest& request) = 0;
  // Aborted when the worker does not hold the job in this epoch any more. A lease that ran out can be renewed as long
  // as nobody took the job over.
  virtual absl::Status RenewLease(const std::string& id, SequenceNumber sequence, int64_t epoch,
                                  const std::string& worker, absl::Time expires_at, absl::Time now) = 0;
  // The job goes back as if nobody had held it. Repeating it is OK.
  virtual absl::Status ReleaseLease(const std::string& id, SequenceNumber sequence, int64_t epoch,
                                    const std::string& worker, absl::Time now) = 0;
  // The job goes back with one failed attempt more. Repeating it is OK and counts once.
  virtual absl::Status FailLease(const std::string& id, SequenceNumber sequence, int64_t epoch,
                                 const std::string& worker, const CameraJobFailure& failure, absl::Time now) = 0;
  // The same for a lease that ran out at `now`; Aborted when it was renewed meanwhile, or is held by somebody else.
  virtual absl::Status ExpireLease(const std::string& id, SequenceNumber sequence, int64_t epoch,
                                   const CameraJobFailure& failure, absl::Time now) = 0;
  virtual absl::StatusOr<std::vector<CameraLease>> ListExpiredLeases(absl::Time now) = 0;
  // Everything that a worker holds, run out or not; "" lists all workers' leases. By reconstruction and sequence.
  virtual absl::StatusOr<std::vector<CameraLease>> ListLeases(const std::string& worker) = 0;

  // Adds commit number `commit.sequence`, which must be the next one, of a job that is done or set aside. The accepted
  // surface must be durable already. Repeating the same commit is OK.
  virtual absl::Status AddCommit(const std::string& id, const Commit& commit, absl::Time now,
                                 int64_t conductor_epoch = 0) = 0;
  // AddCommit for each, then AssignCameraJob for each, in one transaction: one wait for the disk instead of many. When
  // one of them is refused, those before it may stand.
  virtual absl::Status Advance(const std::string& id, const std::vector<Commit>& commits,
                               const std::vector<CameraAssignment>& assignments, absl::Time now,
                               int64_t conductor_epoch = 0) = 0;
  // By sequence, those with a number greater than `after`.
  virtual absl::StatusOr<std::vector<Commit>> ListCommits(const std::string& id, SequenceNumber after = 0) = 0;

  // Takes a reconstruction that nobody conducts (or no longer, or `owner` itself) and returns the epoch, which grows
  // with every call: who conducted before cannot write any more. FailedPrecondition while somebody else holds it.
  virtual absl::StatusOr<int64_t> AcquireConductorLease(const std::string& id, const std::string& owner,
                                                        absl::Time expires_at, absl::Time now) = 0;
  // Aborted when the epoch is not the current one.
  virtual absl::Status RenewConductorLease(const std::string& id, int64_t epoch, absl::Time expires_at,
                                           absl::Time now) = 0;
  // Lets others take over at once. Repeating it is OK.
  virtual absl::Status ReleaseConductorLease(const std::string& id, int64_t epoch, absl::Time now) = 0;
  virtual absl::StatusOr<ConductorLease> GetConductorLease(const std::string& id) = 0;  // NotFound before the first
  // The running reconstructions that nobody conducts at `now`, by id.
  virtual absl::StatusOr<std::vector<std::string>> ListUnconductedReconstructions(absl::Time now) = 0;

  // What a worker says about itself with each heartbeat; a new worker is not drained.
  virtual absl::Status RecordHeartbeat(const std::string& worker, int64_t cores, int64_t memory_bytes,
                                       absl::Time now) = 0;
  virtual absl::Status SetWorkerDrained(const std::string& worker, bool drained) = 0;  // NotFound: never seen
  virtual absl::StatusOr<std::vector<WorkerRecord>> ListWorkers() = 0;                 // by id
  // Forgets a worker. Repeating it is harmless; its leases run out by themselves.
  virtual absl::Status RemoveWorker(const std::string& worker) = 0;
};

// How weak targets stand in the store: numbers with commas between them, "" for none.
std::string JoinCameraIndices(const std::vector<CameraIndex>& cameras);
absl::StatusOr<std::vector<CameraIndex>> SplitCameraIndices(const std::string& text);

// Reasons come from outside, also from dying programs: "?" for every byte that is not UTF-8 text (and for NUL), so that
// every database can hold them.
std::string PrintableText(const std::string& text);

}  // namespace meshwright
