// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <absl/time/time.h>

#include "common/base/ids.h"
#include "common/base/method_version.h"

namespace meshwright {

// created (its scene is still coming) -> preparing -> running -> joining -> done, cancelled or failed; those three are
// final. Deleting comes after any of them, and then nothing.
enum class ReconstructionState { kCreated, kPreparing, kRunning, kJoining, kDone, kCancelled, kFailed, kDeleting };

// How far a reconstruction is.
struct Progress {
  int64_t cameras_total = 0;      // committed, in flight and still waiting; shrinks when pruning leaves one no pair
  int64_t cameras_committed = 0;  // skipped ones included
  int64_t cameras_skipped = 0;
  int64_t cameras_in_flight = 0;
  int64_t patches_filtered = 0;  // over committed cameras
  int64_t patches_accepted = 0;
  int64_t joined_thousandths = 0;                  // of judging again and joining, once all cameras are committed
  absl::Time expected_end = absl::InfinitePast();  // of all of it, mesh included, as far as can be said; or nothing can

  bool operator==(const Progress&) const = default;
};

struct StoredMesh {
  std::string digest;  // in the BlobStore; "" when there is none yet
  int64_t bytes = 0;
  int64_t vertices = 0;
  int64_t faces = 0;
  std::string verdict_json;  // what the reconstruction came to; "" where nobody has said
};

struct Reconstruction {
  std::string id;
  std::string options_json;  // everything beside the scene that the result depends on
  std::string scene_digest;  // SHA-256, 64 hexadecimal digits; empty only before it runs
  ReconstructionState state = ReconstructionState::kRunning;
  std::string state_reason;     // why it was cancelled or failed
  double weight = 1;            // its share of the workers, relative to the others'; at least 0.001
  std::string scene_reference;  // "" when the scene is uploaded
  std::string scene_blob;       // the whole scene in the BlobStore; "" until it is there
  std::string owner;            // the user whose it is; "": nobody's in particular
  absl::Time created_at = absl::UnixEpoch();
  absl::Time finished_at = absl::InfinitePast();  // in a final state only
  StoredMesh mesh;
  Progress progress;
  int64_t method_version = kMethodVersion;  // that it was begun with
};

// The life of a camera job: assigned -> done -> committed, or assigned -> skipped -> committed (with no surface).
// Jobs get done in any order; they are committed in the order of their sequence numbers.
enum class CameraJobState { kAssigned, kDone, kSkipped };

// The sequence, and the camera, of the job that estimates the cameras of photographs: once for a reconstruction that
// begins without them, with leases, failures and attempts as all jobs have them. It runs while the reconstruction is
// being prepared; its result is a blob with the scene. ListCameraJobs and ListResults leave it out.
constexpr SequenceNumber kCameraEstimation = std::numeric_limits<SequenceNumber>::max();
// The same of the job that looks whether the cameras agree with the photographs, before the first camera's job; its
// specification is the digest of the scene, its result that of a CameraRefinement.
constexpr SequenceNumber kCameraRefinement = kCameraEstimation - 1;
constexpr bool IsPreparation(SequenceNumber sequence) { return sequence >= kCameraRefinement; }

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
  std::string skip_reason;
  std::vector<CameraIndex> neighbours;  // O_r as of the snapshot
  std::string spec;                     // what a worker needs to know (job_spec_codec); "" in lists

  int64_t memory_bytes = 0;  // what the job needs; 0 where nobody asks
  int64_t failed_attempts = 0;
  int64_t out_of_memory_failures = 0;  // those of them that ran out of memory
  int64_t losses = 0;                  // attempts whose worker vanished: they say little about the job
  int64_t reduction = 0;               // how many times it was made smaller; part of what the result depends on
  std::string expected_digest;         // it was done before and is done again, as the blob was lost; else ""
  std::string last_failure;
  absl::Time not_before = absl::UnixEpoch();  // is not leased earlier (backoff)
  // The worker that holds it and until when; empty when nobody does, and always when the job is not assigned.
  std::string lease_worker;
  std::string lease_instance;
  absl::Time leased_at = absl::UnixEpoch();
  absl::Time lease_expires_at = absl::UnixEpoch();
};

// A job that is neither done nor skipped, with what has to be known to hand it out.
struct OpenJob {
  std::string reconstruction_id;
  double weight = 1;  // the reconstruction's
  SequenceNumber sequence = 0;
  CameraIndex camera = 0;
  int64_t epoch = 1;
  int64_t memory_bytes = 0;
  int64_t failed_attempts = 0;
  int64_t losses = 0;
  int64_t reduction = 0;
  bool is_repair = false;                   // see CameraJob::expected_digest
  int64_t method_version = kMethodVersion;  // the reconstruction's
  absl::Time not_before;
  std::string lease_worker;  // "" when it waits
  std::string lease_instance;
  absl::Time leased_at;
  absl::Time lease_expires_at;
};

// A job that is done or skipped.
struct JobResult {
  SequenceNumber sequence = 0;
  bool skipped = false;
  int64_t epoch = 1;
  std::string filtered_digest;
  std::vector<CameraIndex> weak_targets;
};

// A camera that was chosen.
struct CameraAssignment {
  SequenceNumber sequence = 0;
  CameraIndex camera = 0;
  SequenceNumber snapshot = 0;
  int64_t memory_bytes = 0;
  std::vector<CameraIndex> neighbours;
  std::string spec;
};

// One thing that happens to one open job, named by sequence and epoch.
struct JobChange {
  enum class Kind {
    kClaim,     // a job that waits is leased to the worker, in the next epoch
    kRenew,     // the lease lasts until expires_at
    kComplete,  // the job is done; also when the lease ran out and nobody has taken the job over
    kSkipped,   // the job is given up with a reason
    // The lease ends and the job waits again, at least until retry_at:
    kRelease,  // not the job's fault, counts for nothing
    kFail,
    kLose,  // the worker has vanished
  };
  Kind kind = Kind::kClaim;
  std::string id;  // the reconstruction's
  SequenceNumber sequence = 0;
  int64_t epoch = 0;
  std::string worker;
  std::string instance;                                    // kClaim: of the worker's process
  absl::Time expires_at;                                   // kClaim, kRenew
  std::string filtered_digest;                             // kComplete; the blob is durable
  std::vector<CameraIndex> weak_targets;                   // kComplete
  std::string report_json;                                 // kComplete
  std::string reason;                                      // kFail, kLose, kSkipped
  absl::Time retry_at = absl::UnixEpoch();                 // kRelease, kFail, kLose
  bool out_of_memory = false;                              // kFail, kSkipped: it ran out of memory
  bool reduce = false;                                     // kFail: make the job smaller from now on,
  int64_t memory_bytes = -1;                               // so that it needs this much
  absl::Time only_if_expired_at = absl::InfiniteFuture();  // kLose: only if the lease has run out by then
};

struct JobChangeResult {
  // OK, or Aborted: the job is not in this epoch, or not held by this worker, any more; drop it. InvalidArgument or
  // FailedPrecondition: the result cannot be stored.
  absl::Status status;
  std::optional<CameraJob> job;  // kClaim
};

// A lease that ended.
struct Attempt {
  SequenceNumber sequence = 0;
  CameraIndex camera = 0;
  int64_t epoch = 0;
  std::string worker;
  absl::Time began_at;
  absl::Time ended_at;
  std::string ending;  // finished, failed, out_of_memory, lost or released
  std::string reason;
};

// Who conducts a reconstruction: chooses its cameras and accepts its surfaces.
struct ConductorLease {
  std::string owner;
  int64_t epoch = 0;
  absl::Time expires_at = absl::UnixEpoch();
};

struct ConductedState {
  std::string id;
  ReconstructionState state = ReconstructionState::kRunning;
  ConductorLease lease;  // epoch 0: nobody ever conducted it
  int64_t method_version = kMethodVersion;
};

struct WorkerRecord {
  std::string id;
  int64_t cores = 0;
  int64_t memory_bytes = 0;
  absl::Time last_heartbeat = absl::UnixEpoch();
  bool drained = false;  // its operator wants no more jobs for this process of it; heartbeats do not say it
  std::string instance;  // of its process
  std::string version;
  bool draining = false;       // it says so itself
  int64_t method_version = 0;  // 0: it does not say
  std::string colmap_version;  // "": it cannot estimate cameras
  std::string owner;           // whose key or certificate it came with; "": nobody asked for one
};

struct SceneFile {
  std::string path;  // relative to the scene's folder
  int64_t size_bytes = 0;
  std::string digest;  // in the BlobStore

  bool operator==(const SceneFile&) const = default;
};

// A key. Its secret is not here: its owner alone has it.
struct AccessToken {
  std::string id;
  std::string digest;  // SHA-256 of the secret, 64 hexadecimal digits
  std::string user;
  std::string role;               // viewer, submitter, operator or worker
  std::string reconstruction_id;  // a share link: the one that it is for; else ""
  absl::Time created_at = absl::UnixEpoch();
  absl::Time expires_at = absl::InfiniteFuture();
  absl::Time revoked_at = absl::InfiniteFuture();

  bool operator==(const AccessToken&) const = default;
};

// What a user has.
struct Usage {
  int64_t reconstructions = 0;
  int64_t scene_bytes = 0;  // uploaded
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

// The memory of reconstructions: what must survive when a process dies, and what several coordinators share. Each
// method is one durable transaction: when it returns OK the change is on disk, otherwise nothing has changed
// (Unavailable: or perhaps it has; every method may be repeated). Thread-safe. Time comes as a parameter; in a cluster
// it is Now(), the one clock that all have in common.
//
// Whoever writes holds something: a conductor its reconstruction (AcquireConductorLease), a worker its jobs (kClaim).
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

  // An id can be used once: AlreadyExists also after the reconstruction was deleted.
  virtual absl::Status CreateReconstruction(const Reconstruction& reconstruction, absl::Time now) = 0;
  virtual absl::StatusOr<Reconstruction> GetReconstruction(const std::string& id) = 0;
  // By id, at most `limit` of those whose id is greater than `after`. Without those that are being deleted.
  virtual absl::StatusOr<std::vector<Reconstruction>> ListReconstructions(
      const std::string& after = "", int64_t limit = std::numeric_limits<int64_t>::max()) = 0;
  // The same, of one owner.
  virtual absl::StatusOr<std::vector<Reconstruction>> ListReconstructionsOf(const std::string& owner,
                                                                            const std::string& after,
                                                                            int64_t limit) = 0;
  virtual absl::StatusOr<Usage> UsageOf(const std::string& owner) = 0;
  // What a user asks for: preparing (start it) or cancelled. FailedPrecondition when it has another final state
  // already.
  virtual absl::Status RequestState(const std::string& id, ReconstructionState state, absl::Time now) = 0;

  // Writes of the conductor, fenced by the epoch of its lease.
  // Gives a reconstruction that does not run yet its scene. Repeating it is OK; FailedPrecondition once it runs.
  virtual absl::Status SetReconstructionScene(const std::string& id, const std::string& scene_digest,
                                              const std::string& scene_blob, int64_t conductor_epoch) = 0;
  // FailedPrecondition when it has another final state already.
  virtual absl::Status SetReconstructionState(const std::string& id, ReconstructionState state,
                                              const std::string& reason, absl::Time now, int64_t conductor_epoch) = 0;
  // Done, with its mesh.
  virtual absl::Status FinishReconstruction(const std::string& id, const StoredMesh& mesh, absl::Time now,
                                            int64_t conductor_epoch) = 0;
  // Adds commits, each of which must be the next one, of jobs that are done or skipped; then the cameras chosen next,
  // each with epoch 1; then how far it is now; all in one transaction. Accepted surfaces must be durable already.
  // Repeating it is OK. When something is refused (FailedPrecondition: out of order, or contradicts what is stored),
  // what stands before it may stay.
  virtual absl::Status Advance(const std::string& id, const std::vector<Commit>& commits,
                               const std::vector<CameraAssignment>& assignments, const Progress& progress,
                               absl::Time now, int64_t conductor_epoch) = 0;
  // Takes a result back, so that the job is done again in a new epoch. With `expected_digest` since the blob is lost:
  // only the same result will do, and what failed before is forgotten. With "" since the result was none: one failure
  // more. Aborted when the job is not done in this epoch.
  virtual absl::Status ReopenCameraJob(const std::string& id, SequenceNumber sequence, int64_t epoch,
                                       const std::string& expected_digest, const std::string& reason,
                                       absl::Time retry_at, int64_t conductor_epoch) = 0;

  // From now on it is only there to be deleted. Repeating it is OK.
  virtual absl::Status BeginDeletion(const std::string& id) = 0;
  // Rows of it and its jobs and commits; its id stays taken. Deleting what is not there is harmless.
  virtual absl::Status DeleteReconstruction(const std::string& id) = 0;

  virtual absl::StatusOr<CameraJob> GetCameraJob(const std::string& id, SequenceNumber sequence) = 0;
  // By sequence, those with a number greater than `after`, without their specs.
  virtual absl::StatusOr<std::vector<CameraJob>> ListCameraJobs(const std::string& id, SequenceNumber after = 0) = 0;
  // The same, of jobs that are done or skipped.
  virtual absl::StatusOr<std::vector<JobResult>> ListResults(const std::string& id, SequenceNumber after = 0) = 0;

  // All open jobs of all reconstructions that run, leased or not, by reconstruction and sequence.
  virtual absl::StatusOr<std::vector<OpenJob>> ListOpenJobs() = 0;
  // What a coordinator's turn changes, in one transaction: one wait for the disk instead of many. Each change stands
  // by itself; two callers never claim the same job, and neither waits for the other's claim.
  virtual absl::StatusOr<std::vector<JobChangeResult>> ApplyChanges(const std::vector<JobChange>& changes,
                                                                    const std::vector<WorkerRecord>& heartbeats,
                                                                    absl::Time now) = 0;
  // The leases that ended, those that began last first. At most 16 of each job are kept.
  virtual absl::StatusOr<std::vector<Attempt>> ListAttempts(const std::string& id, int64_t limit) = 0;

  // By sequence, at most `limit` of those with a number greater than `after`.
  virtual absl::StatusOr<std::vector<Commit>> ListCommits(const std::string& id, SequenceNumber after = 0,
                                                          int64_t limit = std::numeric_limits<int64_t>::max()) = 0;

  // Takes a reconstruction that nobody conducts (or no longer, or `owner` itself) and returns the epoch, which grows
  // with every call: who conducted before cannot write any more. FailedPrecondition while somebody else's lease lasts
  // beyond `lapsed_by`: now, or where it has stood unchanged for its length, whatever a clock says, what it lasts to.
  virtual absl::StatusOr<int64_t> AcquireConductorLease(const std::string& id, const std::string& owner,
                                                        absl::Time expires_at, absl::Time lapsed_by) = 0;
  // Aborted when the epoch is not the current one.
  virtual absl::Status RenewConductorLease(const std::string& id, int64_t epoch, absl::Time expires_at,
                                           absl::Time now) = 0;
  // Lets others take over at once. Repeating it is OK.
  virtual absl::Status ReleaseConductorLease(const std::string& id, int64_t epoch, absl::Time now) = 0;
  virtual absl::StatusOr<ConductorLease> GetConductorLease(const std::string& id) = 0;  // NotFound before the first
  // The reconstructions that are to be conducted (or deleted), and by whom they are, by id.
  virtual absl::StatusOr<std::vector<ConductedState>> ListConducted() = 0;

  virtual absl::Status SetWorkerDrained(const std::string& worker, bool drained) = 0;  // NotFound: never seen
  virtual absl::StatusOr<std::vector<WorkerRecord>> ListWorkers() = 0;                 // by id
  // Forgets workers that hold nothing and have not been heard of since `before`.
  virtual absl::Status RemoveSilentWorkers(absl::Time before) = 0;

  // An uploaded file, whose blob is durable; replaces the one of the same path.
  virtual absl::Status PutSceneFile(const std::string& id, const SceneFile& file) = 0;
  virtual absl::StatusOr<std::vector<SceneFile>> ListSceneFiles(const std::string& id) = 0;  // by path

  // Says that a blob belongs to the reconstruction; to be called before the blob is put. False: a blob of this digest
  // is being deleted just now, ask again before putting it. Surfaces of jobs and commits belong to it anyhow.
  virtual absl::StatusOr<bool> AddBlobRef(const std::string& id, const std::string& digest) = 0;
  // Of a reconstruction that is being deleted: its blobs that no other one has. Who wants to hold one of them has to
  // wait until the rows are deleted too.
  virtual absl::StatusOr<std::vector<std::string>> MarkBlobsForDeletion(const std::string& id) = 0;

  virtual absl::Status CreateToken(const AccessToken& token) = 0;               // AlreadyExists
  virtual absl::StatusOr<AccessToken> GetToken(const std::string& id) = 0;      // NotFound
  virtual absl::StatusOr<std::vector<AccessToken>> ListTokens() = 0;            // the oldest first
  virtual absl::Status RevokeToken(const std::string& id, absl::Time now) = 0;  // NotFound; the first time counts
  // Forgets those that were revoked or expired before.
  virtual absl::Status RemoveDeadTokens(absl::Time before) = 0;

  // A blob that somebody could not read, for the conductor to look into.
  virtual absl::Status ReportDamagedBlob(const std::string& id, const std::string& digest) = 0;
  virtual absl::StatusOr<std::vector<std::string>> ListDamagedBlobs(const std::string& id) = 0;
  virtual absl::Status ForgetDamagedBlob(const std::string& id, const std::string& digest) = 0;
};

// How weak targets stand in the store: numbers with commas between them, "" for none.
std::string JoinCameraIndices(const std::vector<CameraIndex>& cameras);
absl::StatusOr<std::vector<CameraIndex>> SplitCameraIndices(const std::string& text);

// Reasons come from outside, also from dying programs: "?" for every byte that is not UTF-8 text (and for NUL), so that
// every database can hold them.
std::string PrintableText(const std::string& text);

// Whether nothing will change any more, unless it is deleted.
bool IsFinal(ReconstructionState state);

}  // namespace meshwright
