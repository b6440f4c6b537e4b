// SPDX-License-Identifier: Apache-2.0
#include "coordinator/conductor/conductor.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <absl/strings/str_cat.h>

#include "common/base/check.h"
#include "common/base/status_macros.h"
#include "common/job/job_spec_codec.h"
#include "common/surface/codec.h"
#include "coordinator/incidence/target_selection.h"

namespace meshwright {
namespace {

// Commits that are decided quickly share one wait for the disk; none waits much longer than this for another.
constexpr absl::Duration kWriteEvery = absl::Milliseconds(50);

// What judging again takes for each comparison, by what acceptance takes for each, and what the mesh takes for each
// accepted patch on two cores of 2026, s: roughly, for JoiningProgress measures them once they run. The latter is not
// by acceptance, whose comparisons are quick where surfaces hardly overlap.
constexpr double kJudgingByAcceptance = 0.4;
constexpr double kJoiningSecondsPerPatch = 15e-6;

std::string Name(SequenceNumber sequence) { return absl::StrCat("camera job ", sequence); }

absl::Status CheckWeakTargets(const Assignment& assignment, const std::vector<CameraIndex>& weak_targets) {
  for (const CameraIndex target : weak_targets) {
    if (std::binary_search(assignment.neighbours.begin(), assignment.neighbours.end(), target)) continue;
    return absl::InvalidArgumentError(absl::StrCat(Name(assignment.sequence), ": weak target ", target,
                                                   ", expected a neighbour of camera ", assignment.camera));
  }
  return absl::OkStatus();
}

// The bytes of a camera's numbers may differ in the last bits where another machine computed them.
bool AreEqual(const Camera& a, const Camera& b) {
  const auto close = [](double x, double y) { return std::abs(x - y) <= 1e-9 * std::max(1.0, std::abs(y)); };
  bool equal = a.width == b.width && a.height == b.height && close(a.fx, b.fx) && close(a.fy, b.fy) &&
               close(a.cx, b.cx) && close(a.cy, b.cy);
  for (int i = 0; i < 3; ++i) {
    equal = equal && close(a.cam_from_world.translation[i], b.cam_from_world.translation[i]);
    for (int j = 0; j < 3; ++j) {
      equal = equal && close(a.cam_from_world.rotation(i, j), b.cam_from_world.rotation(i, j));
    }
  }
  return equal;
}

// A surface comes from outside: what it says of its camera and its lattice must be what the scene says, or nothing that
// is computed with it has bounds.
absl::Status CheckFits(const SparseSurface& surface, CameraIndex index, const Camera& camera, int lattice_step) {
  if (surface.camera_index != index) {
    return absl::InvalidArgumentError(absl::StrCat("is of camera ", surface.camera_index, ", expected ", index));
  }
  if (!AreEqual(surface.camera, camera)) {
    return absl::InvalidArgumentError(absl::StrCat("its camera is not camera ", index, " of the scene"));
  }
  const Lattice& lattice = surface.lattice;
  const Lattice expected = Lattice::For(camera, std::max(lattice.step, 1));
  if (lattice.step < lattice_step || lattice.columns != expected.columns || lattice.rows != expected.rows) {
    return absl::InvalidArgumentError(absl::StrCat("its lattice is ", lattice.columns, " x ", lattice.rows,
                                                   " with step ", lattice.step, ", which is none of camera ", index));
  }
  return absl::OkStatus();
}

// Keeps the `count` surfaces with the most patches, in ascending order of cameras. Ties: the lower camera.
template <typename Surface>
void KeepLargest(int count, std::vector<Surface>& surfaces) {
  if (surfaces.size() <= static_cast<size_t>(count)) return;
  std::sort(surfaces.begin(), surfaces.end(), [](const Surface& a, const Surface& b) {
    return a.patches != b.patches ? a.patches > b.patches : a.camera < b.camera;
  });
  surfaces.resize(static_cast<size_t>(count));
  std::sort(surfaces.begin(), surfaces.end(), [](const Surface& a, const Surface& b) { return a.camera < b.camera; });
}

}  // namespace

Conductor::Conductor(std::string reconstruction_id, const std::vector<Camera>& cameras, FeasiblePairs pairs,
                     OverlapGraph overlaps, const ConductorOptions& options, JobStore* store, BlobStore* blobs,
                     const Clock* clock, ThreadPool* pool, int64_t epoch, JobBytes job_bytes)
    : reconstruction_id_(std::move(reconstruction_id)),
      scene_cameras_(cameras),
      cameras_(CameraGeometries(cameras)),
      probes_(std::move(pairs.probes)),
      pair_counts_(pairs.counts),
      feasibility_source_(pairs.source),
      overlaps_(std::move(overlaps)),
      options_(options),
      store_(store),
      blobs_(blobs),
      clock_(clock),
      pool_(pool),
      epoch_(epoch),
      job_bytes_(std::move(job_bytes)),
      schedule_(std::move(pairs.matrix), overlaps_,
                ScheduleOptions{.window = options.window, .max_overlap_in_flight = options.acceptance.k_a}),
      to_grow_(cameras_, probes_, overlaps_, options.acceptance.k_a, *pool) {}

absl::StatusOr<std::unique_ptr<Conductor>> Conductor::Open(const std::string& reconstruction_id,
                                                           const std::vector<Camera>& cameras,
                                                           const std::vector<SparsePoint>& points,
                                                           const ConductorOptions& options, JobStore* store,
                                                           BlobStore* blobs, const Clock* clock, ThreadPool* pool,
                                                           int64_t epoch, JobBytes job_bytes) {
  MW_RETURN_IF_ERROR(options.Validate());
  MW_RETURN_IF_ERROR(store->GetReconstruction(reconstruction_id).status());
  MW_ASSIGN_OR_RETURN(FeasiblePairs pairs, FindFeasiblePairs(cameras, points, options.pairs, *pool));
  OverlapGraph overlaps = FindOverlaps(CameraGeometries(cameras), pairs.probes, pairs.matrix, options.overlap, *pool);
  auto conductor =
      std::unique_ptr<Conductor>(new Conductor(reconstruction_id, cameras, std::move(pairs), std::move(overlaps),
                                               options, store, blobs, clock, pool, epoch, std::move(job_bytes)));
  MW_ASSIGN_OR_RETURN(const std::vector<CameraJob> jobs, store->ListCameraJobs(reconstruction_id));
  MW_ASSIGN_OR_RETURN(const std::vector<Commit> commits, store->ListCommits(reconstruction_id));
  const MutexLock lock(conductor->mutex_);
  for (CameraIndex camera = 0; camera < conductor->schedule_.matrix().cameras(); ++camera) {
    if (!conductor->schedule_.IsToCome(camera)) conductor->to_grow_.Commit(camera, /*is_processed=*/false);
  }
  MW_RETURN_IF_ERROR(conductor->Replay(jobs, commits));
  return conductor;
}

absl::Status Conductor::Replay(const std::vector<CameraJob>& jobs, const std::vector<Commit>& commits) {
  if (jobs.size() < commits.size()) return absl::DataLossError("the store holds commits without jobs");
  for (size_t i = 0; i < commits.size(); ++i) {
    const Commit& commit = commits[i];
    if (schedule_.in_flight().empty() || schedule_.in_flight().front().camera != commit.camera ||
        schedule_.in_flight().front().sequence != commit.sequence) {
      return absl::DataLossError(absl::StrCat("commit ", commit.sequence, " (camera ", commit.camera,
                                              ") is not what this scene and these options give"));
    }
    const bool is_made_again = !jobs[i].expected_digest.empty();
    const JobResult result = {.skipped = jobs[i].state == CameraJobState::kSkipped,
                              .filtered_digest = is_made_again ? jobs[i].expected_digest : jobs[i].filtered_digest,
                              .weak_targets = jobs[i].weak_targets};
    MW_RETURN_IF_ERROR(schedule_.Commit(OutcomeOf(schedule_.in_flight().front(), result)));
    Remember(commit, result);
  }
  for (const Assignment& assignment : schedule_.TakeChoices()) {
    const auto index = static_cast<size_t>(assignment.sequence) - 1;
    if (index >= jobs.size()) {
      Assign(assignment);
      continue;
    }
    const CameraJob& job = jobs[index];
    if (job.camera != assignment.camera || job.snapshot != assignment.snapshot) {
      return absl::DataLossError(
          absl::StrCat(Name(job.sequence), " (camera ", job.camera, ") is not what this scene and these options give"));
    }
  }
  // What is assigned waits in the store, or is at a worker; what is done is what IngestResults() finds.
  return Flush();
}

void Conductor::Assign(const Assignment& assignment) {
  CameraJobSpec spec = SpecFor(assignment);
  std::vector<int64_t> bytes = job_bytes_(spec);
  unwritten_assignments_.push_back({.sequence = spec.sequence,
                                    .camera = spec.camera,
                                    .snapshot = spec.snapshot,
                                    .memory_bytes = bytes.front(),
                                    .neighbours = std::move(spec.neighbours),
                                    .spec = EncodeJobSpec({.targets = std::move(spec.targets),
                                                           .accepted = std::move(spec.accepted),
                                                           .memory_bytes = std::move(bytes)})});
}

absl::Status Conductor::Flush() {
  if (unwritten_commits_.empty() && unwritten_assignments_.empty()) return absl::OkStatus();
  MW_RETURN_IF_ERROR(store_->Advance(reconstruction_id_, unwritten_commits_, unwritten_assignments_, CurrentProgress(),
                                     clock_->Now(), epoch_));
  unwritten_commits_.clear();
  unwritten_assignments_.clear();
  return absl::OkStatus();
}

absl::StatusOr<bool> Conductor::IngestResults(int max_failures) {
  const MutexLock lock(mutex_);
  damaged_blob_.clear();
  MW_ASSIGN_OR_RETURN(const std::vector<JobResult> results,
                      store_->ListResults(reconstruction_id_, schedule_.commits()));
  for (const JobResult& result : results) MW_RETURN_IF_ERROR(Receive(result, max_failures));
  const SequenceNumber before = LastChoice();
  const absl::Status status = CommitWhatIsNext();
  if (absl::IsInvalidArgument(status) && !schedule_.in_flight().empty()) {
    // The next in line is no surface.
    const auto found = finished_.find(schedule_.in_flight().front().sequence);
    const JobResult result = found->second;
    finished_.erase(found);
    MW_RETURN_IF_ERROR(Reject(result, std::string(status.message()), max_failures));
  } else {
    MW_RETURN_IF_ERROR(status);
  }
  return LastChoice() > before;
}

SequenceNumber Conductor::LastChoice() const {
  return schedule_.commits() + static_cast<SequenceNumber>(schedule_.in_flight().size());
}

absl::Status Conductor::Receive(const JobResult& result, int max_failures) {
  const auto known = finished_.find(result.sequence);
  if (known != finished_.end() && known->second.epoch == result.epoch) return absl::OkStatus();
  MW_ASSIGN_OR_RETURN(const Assignment* const assignment, FindInFlight(result.sequence));
  if (!result.skipped) {
    const absl::Status valid = CheckWeakTargets(*assignment, result.weak_targets);
    if (!valid.ok()) return Reject(result, std::string(valid.message()), max_failures);
    MW_ASSIGN_OR_RETURN(const bool durable, blobs_->Has(result.filtered_digest));
    if (!durable) {
      return Reject(result, absl::StrCat("its surface ", result.filtered_digest, " is not there"), max_failures);
    }
  }
  finished_[result.sequence] = result;
  return absl::OkStatus();
}

absl::Status Conductor::Reject(const JobResult& result, const std::string& reason, int max_failures) {
  MW_RETURN_IF_ERROR(
      store_->ReopenCameraJob(reconstruction_id_, result.sequence, result.epoch, "", reason, clock_->Now(), epoch_));
  MW_ASSIGN_OR_RETURN(const CameraJob job, store_->GetCameraJob(reconstruction_id_, result.sequence));
  if (job.failed_attempts < max_failures) return absl::OkStatus();
  const JobChange skip = {.kind = JobChange::Kind::kSkipped,
                          .id = reconstruction_id_,
                          .sequence = result.sequence,
                          .epoch = job.epoch,
                          .reason = reason};
  // Refused when a worker has just claimed it: it gets one attempt more.
  return store_->ApplyChanges({skip}, {}, clock_->Now()).status();
}

std::string Conductor::damaged_blob() const {
  const MutexLock lock(mutex_);
  return damaged_blob_;
}

bool Conductor::HasAccepted(const std::string& accepted_digest) const {
  const MutexLock lock(mutex_);
  return std::any_of(committed_.begin(), committed_.end(),
                     [&](const auto& one) { return one.second.accepted.digest == accepted_digest; });
}

absl::Status Conductor::RemakeAccepted(const std::string& accepted_digest) {
  const MutexLock lock(mutex_);
  damaged_blob_.clear();
  for (const auto& [camera, committed] : committed_) {
    if (committed.accepted.digest != accepted_digest) continue;
    MW_ASSIGN_OR_RETURN(const Commit again, Accept(committed.sequence, camera, committed.filtered_digest));
    if (again.accepted_digest == accepted_digest) return absl::OkStatus();
    return absl::FailedPreconditionError(absl::StrCat("the accepted surface ", accepted_digest, " of camera ", camera,
                                                      " is lost, and made again it is another one, ",
                                                      again.accepted_digest));
  }
  return absl::NotFoundError(absl::StrCat("no accepted surface is ", accepted_digest));
}

SequenceNumber Conductor::JobOfFiltered(const std::string& filtered_digest) const {
  const MutexLock lock(mutex_);
  for (const auto& [camera, committed] : committed_) {
    if (committed.filtered_digest == filtered_digest) return committed.sequence;
  }
  for (const auto& [sequence, outcome] : finished_) {
    if (outcome.filtered_digest == filtered_digest) return sequence;
  }
  return 0;
}

absl::StatusOr<const Assignment*> Conductor::FindInFlight(SequenceNumber sequence) const {
  for (const Assignment& assignment : schedule_.in_flight()) {
    if (assignment.sequence == sequence) return &assignment;
  }
  return absl::NotFoundError(absl::StrCat(Name(sequence), " was not handed out"));
}

absl::Status Conductor::CommitWhatIsNext() {
  absl::Time written = clock_->Now();
  absl::Status status;
  while (status.ok() && !schedule_.in_flight().empty()) {
    const Assignment assignment = schedule_.in_flight().front();
    const auto found = finished_.find(assignment.sequence);
    if (found == finished_.end()) break;
    const JobResult& result = found->second;
    Commit commit = {.sequence = assignment.sequence, .camera = assignment.camera};
    if (!result.skipped) {
      absl::StatusOr<Commit> accepted = Accept(assignment.sequence, assignment.camera, result.filtered_digest);
      status = accepted.status();
      if (!status.ok()) break;
      commit = *std::move(accepted);
    }
    unwritten_commits_.push_back(commit);
    MW_RETURN_IF_ERROR(schedule_.Commit(OutcomeOf(assignment, result)));
    Remember(commit, result);
    finished_.erase(found);
    for (const Assignment& choice : schedule_.TakeChoices()) Assign(choice);
    if (clock_->Now() - written < kWriteEvery) continue;
    MW_RETURN_IF_ERROR(Flush());
    written = clock_->Now();
  }
  MW_RETURN_IF_ERROR(Flush());
  return status;
}

absl::StatusOr<std::shared_ptr<const SparseSurface>> Conductor::LoadSurface(const std::string& digest,
                                                                            CameraIndex camera) {
  const absl::StatusOr<std::string> bytes = blobs_->Get(digest);
  if (absl::IsDataLoss(bytes.status()) || absl::IsNotFound(bytes.status())) damaged_blob_ = digest;
  MW_RETURN_IF_ERROR(bytes.status());
  absl::StatusOr<SparseSurface> surface = DecodeSparseSurface(*bytes);
  if (!surface.ok()) return absl::InvalidArgumentError(surface.status().message());
  const absl::Status fits =
      CheckFits(*surface, camera, scene_cameras_[static_cast<size_t>(camera)], options_.lattice_step);
  if (!fits.ok()) return absl::InvalidArgumentError(absl::StrCat("surface ", digest, ": ", fits.message()));
  return std::make_shared<const SparseSurface>(*std::move(surface));
}

// The largest filtered surfaces that overlap the camera's and were committed before `before`.
std::vector<CommittedSurface::Supporter> Conductor::SupportersOf(CameraIndex camera, SequenceNumber before) const {
  std::vector<CommittedSurface::Supporter> supporters;
  for (const CameraIndex other : overlaps_.Of(camera)) {
    const auto found = committed_.find(other);
    if (found == committed_.end() || found->second.sequence >= before || found->second.filtered_digest.empty()) {
      continue;
    }
    supporters.push_back({other, found->second.filtered_digest, found->second.filtered_patches});
  }
  KeepLargest(options_.max_surfaces, supporters);
  return supporters;
}

// Section 3.7: what of F_r is supported by the filtered surfaces of enough cameras committed before becomes M_r.
absl::StatusOr<Commit> Conductor::Accept(SequenceNumber sequence, CameraIndex camera,
                                         const std::string& filtered_digest) {
  MW_ASSIGN_OR_RETURN(const std::shared_ptr<const SparseSurface> filtered, LoadSurface(filtered_digest, camera));
  const std::vector<CommittedSurface::Supporter> supporters = SupportersOf(camera, sequence);
  const auto load = [&](int i) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) {
    const CommittedSurface::Supporter& supporter = supporters[static_cast<size_t>(i)];
    absl::StatusOr<std::shared_ptr<const SparseSurface>> surface = LoadSurface(supporter.digest, supporter.camera);
    // It was committed: not the fault of the camera that is next.
    if (absl::IsInvalidArgument(surface.status())) surface = absl::DataLossError(surface.status().message());
    return surface;
  };
  const Stopwatch stopwatch;
  MW_ASSIGN_OR_RETURN(
      const AcceptanceResult result,
      AcceptSurface(filtered->ToLattice(), static_cast<int>(supporters.size()), load, options_.acceptance, *pool_));
  acceptance_times_.seconds += stopwatch.Seconds();
  acceptance_times_.comparisons +=
      static_cast<double>(result.patches_filtered) * static_cast<double>(supporters.size());
  Commit commit = {.sequence = sequence,
                   .camera = camera,
                   .filtered_patches = result.patches_filtered,
                   .accepted_patches = result.patches_accepted};
  if (result.patches_accepted > 0) {
    MW_ASSIGN_OR_RETURN(commit.accepted_digest, blobs_->Put(EncodeSurface(result.accepted)));
  }
  return commit;
}

void Conductor::Remember(const Commit& commit, const JobResult& result) {
  const double expected_rays = RaysOf(commit.camera) * to_grow_.ShareNow(commit.camera);
  to_grow_.Commit(commit.camera, !result.skipped);
  committed_[commit.camera] = {.sequence = commit.sequence,
                               .filtered_digest = commit.filtered_patches > 0 ? result.filtered_digest : std::string(),
                               .filtered_patches = commit.filtered_patches,
                               .accepted = {.sequence = commit.sequence,
                                            .camera = commit.camera,
                                            .digest = commit.accepted_digest,
                                            .patches = commit.accepted_patches},
                               .expected_rays = expected_rays};
  if (result.skipped) ++progress_.cameras_skipped;
  progress_.patches_filtered += commit.filtered_patches;
  progress_.patches_accepted += commit.accepted_patches;
}

JobOutcome Conductor::OutcomeOf(const Assignment& assignment, const JobResult& result) const {
  // Nobody can use the image of a camera that was skipped: all its pairs go.
  return {.sequence = assignment.sequence,
          .camera = assignment.camera,
          .weak_targets = result.skipped ? schedule_.matrix().Neighbours(assignment.camera) : result.weak_targets,
          .skipped = result.skipped};
}

CameraJobSpec Conductor::SpecFor(const Assignment& assignment) const {
  CameraJobSpec spec = {
      .sequence = assignment.sequence,
      .camera = assignment.camera,
      .snapshot = assignment.snapshot,
      .neighbours = assignment.neighbours,
      .targets = ChooseTargets(assignment.camera, assignment.neighbours, cameras_, probes_, options_.targets)};
  for (const CameraIndex other : overlaps_.Of(assignment.camera)) {
    const auto found = committed_.find(other);
    if (found == committed_.end() || found->second.accepted.patches == 0) continue;
    if (found->second.accepted.sequence <= assignment.snapshot) spec.accepted.push_back(found->second.accepted);
  }
  return spec;
}

Progress Conductor::progress() const {
  const MutexLock lock(mutex_);
  return CurrentProgress();
}

Progress Conductor::CurrentProgress() const {
  Progress progress = progress_;
  progress.cameras_committed = schedule_.commits();
  progress.cameras_in_flight = static_cast<int64_t>(schedule_.in_flight().size());
  progress.cameras_total = progress.cameras_committed + progress.cameras_in_flight + schedule_.waiting_cameras();
  return progress;
}

double Conductor::RaysOf(CameraIndex camera) const {
  const Camera& pinhole = scene_cameras_[static_cast<size_t>(camera)];
  return static_cast<double>(Lattice::For(pinhole, options_.lattice_step).nodes());
}

double Conductor::ExpectedRays(CameraIndex camera) const {
  const MutexLock lock(mutex_);
  const auto found = committed_.find(camera);
  return found == committed_.end() ? 0 : found->second.expected_rays;
}

void Conductor::SetExpectedEnd(absl::Time expected_end) {
  const MutexLock lock(mutex_);
  progress_.expected_end = expected_end;
}

ForecastInput Conductor::ForecastNow() const {
  const MutexLock lock(mutex_);
  ForecastInput input;
  for (CameraIndex camera = 0; camera < schedule_.matrix().cameras(); ++camera) {
    if (schedule_.IsToCome(camera)) input.left.Add(RaysOf(camera) * to_grow_.ExpectedShare(camera));
  }
  double done_rays = 0;
  double comparisons = 0;  // that judging again takes, of the cameras that are committed
  for (const auto& [camera, committed] : committed_) {
    done_rays += committed.expected_rays;
    const size_t supporters = std::min(overlaps_.Of(camera).size(), static_cast<size_t>(options_.max_surfaces));
    comparisons += static_cast<double>(committed.filtered_patches) * static_cast<double>(supporters);
  }
  if (!(acceptance_times_.comparisons > 0) || !(done_rays > 0)) return input;
  const double seconds = acceptance_times_.seconds / acceptance_times_.comparisons;
  const double all_by_done = (done_rays + input.left.expected_rays) / done_rays;
  input.judging_seconds = kJudgingByAcceptance * seconds * comparisons * all_by_done;
  input.joining_seconds = kJoiningSecondsPerPatch * static_cast<double>(progress_.patches_accepted) * all_by_done;
  return input;
}

bool Conductor::finished() const {
  const MutexLock lock(mutex_);
  return schedule_.finished();
}

std::vector<AcceptedSurface> Conductor::AcceptedSurfaces() const {
  const MutexLock lock(mutex_);
  std::vector<AcceptedSurface> surfaces;
  for (const auto& [camera, committed] : committed_) {
    if (committed.accepted.patches > 0) surfaces.push_back(committed.accepted);
  }
  std::sort(surfaces.begin(), surfaces.end(),
            [](const AcceptedSurface& a, const AcceptedSurface& b) { return a.sequence < b.sequence; });
  return surfaces;
}

std::vector<CommittedSurface> Conductor::CommittedSurfaces() const {
  const MutexLock lock(mutex_);
  std::vector<CommittedSurface> surfaces;
  for (const auto& [camera, committed] : committed_) {
    if (committed.filtered_digest.empty()) continue;
    surfaces.push_back({.accepted = committed.accepted,
                        .filtered_digest = committed.filtered_digest,
                        .supporters = SupportersOf(camera, std::numeric_limits<SequenceNumber>::max())});
  }
  std::sort(surfaces.begin(), surfaces.end(), [](const CommittedSurface& a, const CommittedSurface& b) {
    return a.accepted.sequence < b.accepted.sequence;
  });
  return surfaces;
}

}  // namespace meshwright
