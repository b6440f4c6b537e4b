// SPDX-License-Identifier: Apache-2.0
#include "pipeline/local/local_reconstruction.h"

#include <algorithm>
#include <filesystem>
#include <memory>
#include <system_error>
#include <utility>
#include <vector>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include "pipeline/config/parse_config.h"
#include "pipeline/local/work_folder.h"
#include "pipeline/options/options_json.h"
#include "pipeline/refinement/refine_cameras.h"
#include "pipeline/report/cameras_report.h"
#include "pipeline/report/report_page.h"
#include "pipeline/report/verdict.h"
#include "pipeline/texturing/texture_mesh.h"

#include "common/base/bad_input.h"
#include "common/base/clock.h"
#include "common/base/files.h"
#include "common/base/process_usage.h"
#include "common/base/status_macros.h"
#include "common/base/version.h"
#include "common/blob/lost_blob.h"
#include "common/json/json_text.h"
#include "common/mesh/formats/mesh_format.h"
#include "common/mesh/surface_mesh.h"
#include "common/scene/scene_check.h"
#include "common/scene/view.h"
#include "coordinator/conductor/accepted_mesh.h"
#include "coordinator/conductor/conductor_lease.h"
#include "coordinator/conductor/final_surfaces.h"
#include "coordinator/conductor/joining_progress.h"
#include "coordinator/conductor/outer_loop.h"
#include "worker/job_input/view_cache.h"

namespace meshwright {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

// Names this process as the conductor of its reconstruction.
constexpr char kConductor[] = "local";
constexpr absl::Duration kConductorLease = absl::Minutes(1);
// The mesh's parts of which progress is told.
constexpr int kThousandths = 1000;
// Surfaces that are found damaged or lost when the mesh is written are made again so often.
constexpr int kMaxRepairs = 100;

// What decoded photographs may take that no job uses at the moment: twice what the running jobs hold, whatever the
// number of cameras, and at most a quarter of the memory limit.
int64_t ViewCacheBytes(const std::vector<Camera>& cameras, const ReconstructionOptions& options,
                       const LocalSettings& settings) {
  int64_t largest = 0;
  for (const Camera& camera : cameras) largest = std::max(largest, SamplingImageBytes(camera.width, camera.height));
  const int64_t views_in_use =
      int64_t{ConcurrentJobs(options, settings.threads)} * (options.conductor.targets.max_targets + 1);
  return std::min(settings.memory_limit_bytes / 4, 2 * views_in_use * largest);
}

// Whether files can be made beside `path`: better known before hours of work than after.
absl::Status CheckWritable(const std::string& path) { return AtomicFile::Create(path).status(); }

// Whether `path` is one of the photographs, also by a link or by another spelling of its folder.
absl::Status CheckIsNoPhotograph(const Scene& scene, const std::string& path) {
  std::error_code error;
  for (const SceneView& view : scene.views) {
    if (fs::equivalent(path, view.image_path, error)) {
      return absl::InvalidArgumentError(
          absl::StrCat(path, ": a photograph of the scene; the name of another file expected"));
    }
  }
  return absl::OkStatus();
}

// A file's size and time of change: another pair means other bytes.
struct FileStamp {
  uintmax_t bytes = 0;
  fs::file_time_type changed;
  bool operator==(const FileStamp& other) const { return bytes == other.bytes && changed == other.changed; }
};

FileStamp StampOf(const std::string& path) {
  std::error_code error;  // leaves values that no file has, and reading it will say why
  return {fs::file_size(path, error), fs::last_write_time(path, error)};
}

// NNNN_name.ply, in the order of commits; what was accepted at the end only is a part of its own.
std::string PartName(const Scene& scene, const AcceptedSurface& surface, bool is_late) {
  std::string name = fs::path(scene.views[static_cast<size_t>(surface.camera)].name).stem().string();
  for (char& c : name) {
    const bool plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-';
    if (!plain) c = '_';
  }
  return absl::StrFormat("%04d_%s%s.ply", surface.sequence, name, is_late ? "_late" : "");
}

absl::Status MakePartsFolder(const std::string& path) {
  std::error_code error;
  fs::create_directory(path, error);
  if (error) return absl::PermissionDeniedError(absl::StrCat(path, ": cannot make the folder: ", error.message()));
  return absl::OkStatus();
}

absl::Status WriteParts(const Scene& scene, const std::vector<AcceptedSurface>& surfaces, BlobStore& blobs,
                        const std::string& folder) {
  SequenceNumber previous = 0;
  bool is_late = false;  // they come behind the others, in the order of commits too
  for (const AcceptedSurface& accepted : surfaces) {
    is_late = is_late || accepted.sequence <= previous;
    previous = accepted.sequence;
    MW_ASSIGN_OR_RETURN(const PatchLattice surface, LoadAcceptedSurface(blobs, accepted));
    MW_RETURN_IF_ERROR(
        WriteSurfacePart(surface, scene.offset, absl::StrCat(folder, "/", PartName(scene, accepted, is_late))));
  }
  return absl::OkStatus();
}

std::string DescribeNothing(const ReportTotals& totals, const ReconstructionOptions& options) {
  return absl::StrFormat(
      "nothing was reconstructed: %d seeds, %d rays grown, %d filtered, none supported by %d other cameras; are the "
      "cameras right, and do the photographs show the same surface?",
      totals.seeds, totals.rays_grown, totals.rays_filtered, options.conductor.acceptance.k_a);
}

Json PairsToJson(const Conductor& conductor) {
  const FeasiblePairCounts& counts = conductor.pair_counts();
  const bool points = conductor.feasibility_source() == FeasibilitySource::kSparsePoints;
  return {{"from", points ? "sparse points" : "optical axes"},
          {"feasible", counts.feasible},
          {"cameras_without_pair", counts.cameras_without_pair}};
}

// How far they were off; the poses themselves are in settings_.cameras_path.
Json RefinementToJson(const CameraRefinement& refinement) {
  Json json = {{"moved", refinement.moved()},
               {"tie_points", refinement.tie_points},
               {"error_px_before", refinement.error_px_before},
               {"error_px_after", refinement.error_px_after},
               {"off_px", refinement.off_px}};
  if (!refinement.reason.empty()) json["reason"] = refinement.reason;
  return json;
}

class LocalReconstruction {
 public:
  LocalReconstruction(const Scene& scene, const ReconstructionOptions& options, const LocalSettings& settings,
                      const CameraJobFunction& job, const ProgressListener& listener)
      : scene_(scene), options_(options), settings_(settings), job_(job), listener_(listener) {}

  absl::StatusOr<Json> Run() {
    MW_RETURN_IF_ERROR(options_.Validate());
    MW_ASSIGN_OR_RETURN(format_, MeshFormatOfPath(settings_.output_path));
    for (const std::string& path :
         {settings_.output_path, settings_.report_path, settings_.cameras_path, settings_.page_path}) {
      if (path.empty()) continue;
      MW_RETURN_IF_ERROR(CheckIsNoPhotograph(scene_, path));
      MW_RETURN_IF_ERROR(CheckWritable(path));
    }
    if (!settings_.parts_folder.empty()) MW_RETURN_IF_ERROR(MakePartsFolder(settings_.parts_folder));
    MW_RETURN_IF_ERROR(OpenWorkFolder());
    RemovePartialFiles(settings_.output_path);
    RemovePartialFiles(settings_.report_path);
    if (!settings_.page_path.empty()) RemovePartialFiles(settings_.page_path);
    MW_RETURN_IF_ERROR(Refine());
    MW_RETURN_IF_ERROR(OpenLoop());
    absl::StatusOr<Json> report = RunJobsAndWriteResults();
    lease_->Release(clock_.Now()).IgnoreError();
    MW_RETURN_IF_ERROR(report.status());
    if (!settings_.keep_work_folder) {
      loop_.reset();
      MW_RETURN_IF_ERROR(work_->Remove());
    }
    return report;
  }

 private:
  void Tell(LocalStage stage, int done, int total) {
    progress_.stage = stage;
    progress_.done = done;
    progress_.total = total;
    listener_(progress_);
  }

  absl::Status OpenWorkFolder() {
    const auto photographs = static_cast<int>(scene_.views.size());
    for (const SceneView& view : scene_.views) stamps_.push_back(StampOf(view.image_path));
    Tell(LocalStage::kChecking, 0, photographs);
    MW_ASSIGN_OR_RETURN(const std::string digest, CheckAndDigestScene(scene_, pool_, [&](int checked) {
                          Tell(LocalStage::kChecking, checked, photographs);
                        }));
    MW_ASSIGN_OR_RETURN(
        work_, WorkFolder::Open(settings_.work_folder, digest, JsonText(ToJson(options_)), settings_.restart, clock_));
    return absl::OkStatus();
  }

  // Once: what came out of it is kept with the state.
  absl::Status Refine() {
    const std::string path = work_->RefinementPath();
    const absl::StatusOr<std::string> kept = ReadFile(path);
    if (kept.ok()) {
      MW_ASSIGN_OR_RETURN(refinement_, DecodeCameraRefinement(*kept));
      return ApplyRefinement(refinement_, scene_);
    }
    Tell(LocalStage::kRefining, 0, kThousandths);
    const RefinementEnvironment environment = {
        .load = [this](CameraIndex camera, int max_image_size) { return LoadUnchanged(camera, max_image_size); },
        .pool = &pool_,
        .progress =
            [this](double done) {
              Tell(LocalStage::kRefining, static_cast<int>(kThousandths * done), kThousandths);
              return true;
            }};
    MW_ASSIGN_OR_RETURN(refinement_, RefineCameras(scene_, options_, environment));
    MW_RETURN_IF_ERROR(WriteFileAtomically(path, EncodeCameraRefinement(refinement_)));
    return ApplyRefinement(refinement_, scene_);
  }

  absl::Status OpenLoop() {
    Tell(LocalStage::kPairs, 0, 0);
    for (const SceneView& view : scene_.views) {
      cameras_.push_back(UndistortedCamera(view, options_.max_image_size));
    }
    blobs_.emplace(work_->blobs());
    const absl::Time now = clock_.Now();
    MW_ASSIGN_OR_RETURN(lease_, HeldConductorLease::Acquire(work_->store(), WorkFolder::kReconstructionId, kConductor,
                                                            kConductorLease, now, /*lapsed_by=*/now));
    MW_ASSIGN_OR_RETURN(const ReconstructionConfig config, ParseConfig(JsonText(ToJson(options_))));
    const OuterLoopEnvironment environment = {
        .store = &work_->store(), .blobs = &*blobs_, .clock = &clock_, .pool = &pool_};
    MW_ASSIGN_OR_RETURN(loop_, OuterLoop::Open(environment, WorkFolder::kReconstructionId, lease_->epoch(), cameras_,
                                               scene_.points, config));
    progress_.resumed_from = static_cast<int>(loop_->conductor().progress().cameras_committed);
    return MakeCamerasReport(scene_, work_->store(), WorkFolder::kReconstructionId, &totals_).status();
  }

  absl::StatusOr<Json> RunJobsAndWriteResults() {
    for (int repairs = 0;; ++repairs) {
      MW_RETURN_IF_ERROR(SetState(ReconstructionState::kRunning));
      MW_RETURN_IF_ERROR(RunJobs());
      MW_RETURN_IF_ERROR(SetState(ReconstructionState::kJoining));
      absl::StatusOr<Json> report = WriteResults();
      const std::string lost = LostBlobOf(report.status());
      if (lost.empty() || repairs == kMaxRepairs) return report;
      MW_RETURN_IF_ERROR(work_->store().ReportDamagedBlob(WorkFolder::kReconstructionId, lost));
    }
  }

  absl::Status SetState(ReconstructionState state) {
    return work_->store().SetReconstructionState(WorkFolder::kReconstructionId, state, "", clock_.Now(),
                                                 lease_->epoch());
  }

  absl::Status RunJobs() {
    ViewCache views([&](CameraIndex camera) { return LoadUnchanged(camera, options_.max_image_size); },
                    ViewCacheBytes(cameras_, options_, settings_));
    const CameraJobInputMaker inputs(scene_, cameras_, views, *blobs_, options_.job.lattice_step);
    JobRunner runner({.scene = scene_,
                      .inputs = inputs,
                      .job = job_,
                      .loop = *loop_,
                      .lease = *lease_,
                      .store = work_->store(),
                      .blobs = *blobs_,
                      .pool = pool_},
                     {.concurrent_jobs = ConcurrentJobs(options_, settings_.threads),
                      .memory_limit_bytes = settings_.memory_limit_bytes});
    TellCameras();
    return runner.Run([&](const CameraJobReport& report) {
      totals_.rays += report.rays;
      totals_.rays_covered_before += report.rays_covered_before;
      totals_.rays_grown += report.rays_grown;
      TellCameras();
    });
  }

  // What was digested for the work folder and what is used must be the same.
  absl::StatusOr<View> LoadUnchanged(CameraIndex camera, int max_image_size) const {
    const auto index = static_cast<size_t>(camera);
    const SceneView& scene_view = scene_.views[index];
    absl::StatusOr<View> view = LoadView(scene_view, max_image_size);
    if (StampOf(scene_view.image_path) == stamps_[index]) return view;
    return BadInput(absl::FailedPreconditionError(
        absl::StrCat(scene_view.image_path,
                     ": changed while it was used; photographs must stay as they are until the mesh is there")));
  }

  void TellCameras() {
    const Progress conducted = loop_->conductor().progress();
    const double rays = std::max<double>(1, static_cast<double>(totals_.rays));
    progress_.share_covered = static_cast<double>(totals_.rays_covered_before) / rays;
    progress_.share_grown = static_cast<double>(totals_.rays_grown) / rays;
    progress_.share_accepted = static_cast<double>(conducted.patches_accepted) / rays;
    const bool is_known = conducted.expected_end != absl::InfinitePast();
    progress_.seconds_left =
        is_known ? std::max(0.0, absl::ToDoubleSeconds(conducted.expected_end - clock_.Now())) : -1;
    Tell(LocalStage::kCameras, static_cast<int>(conducted.cameras_committed),
         static_cast<int>(conducted.cameras_total));
  }

  absl::StatusOr<Json> WriteResults() {
    const std::vector<CommittedSurface> committed = loop_->conductor().CommittedSurfaces();
    const ForecastInput forecast = loop_->conductor().ForecastNow();
    JoiningProgress joining(forecast.judging_seconds, forecast.joining_seconds, clock_);
    const auto tell = [&](LocalStage stage, int done, int total) {
      progress_.seconds_left = joining.seconds_left();
      Tell(stage, done, total);
    };
    tell(LocalStage::kJudging, 0, static_cast<int>(committed.size()));
    MW_ASSIGN_OR_RETURN(const JudgedSurfaces judged_surfaces,
                        JudgeCommittedSurfaces(
                            committed, options_.conductor.acceptance, *blobs_,
                            [&](const std::string& bytes) { return blobs_->Put(bytes); }, pool_,
                            [&](int judged) {
                              joining.SetJudged(static_cast<double>(judged) / static_cast<double>(committed.size()));
                              tell(LocalStage::kJudging, judged, static_cast<int>(committed.size()));
                            }));
    const std::vector<AcceptedSurface>& surfaces = judged_surfaces.surfaces;
    const auto tell_joined = [&](double share) {
      joining.SetJoined(share);
      tell(LocalStage::kJoining, static_cast<int>(kThousandths * share), kThousandths);
    };
    tell_joined(0);
    MW_ASSIGN_OR_RETURN(Json cameras,
                        MakeCamerasReport(scene_, work_->store(), WorkFolder::kReconstructionId, &totals_));
    cameras["verdict"] = MakeVerdict(judged_surfaces.cameras, cameras["cameras"]);
    if (refinement_.moved()) cameras["verdict"]["refined_px"] = refinement_.off_px;
    if (surfaces.empty()) return absl::FailedPreconditionError(DescribeNothing(totals_, options_));
    if (!settings_.parts_folder.empty()) {
      MW_RETURN_IF_ERROR(WriteParts(scene_, surfaces, *blobs_, settings_.parts_folder));
    }
    if (settings_.accepted_listener) {
      for (const AcceptedSurface& surface : surfaces) {
        MW_ASSIGN_OR_RETURN(const PatchLattice accepted, LoadAcceptedSurface(*blobs_, surface));
        settings_.accepted_listener(accepted);
      }
    }
    const std::string ply_path = IsPly(*format_) ? settings_.output_path : work_->MeshPath();
    MW_ASSIGN_OR_RETURN(const JoinedMeshCounts counts, WriteAcceptedMesh(surfaces, *blobs_, options_.join,
                                                                         scene_.offset, ply_path, pool_, tell_joined));
    if (counts.faces == 0) {
      std::error_code error;
      fs::remove(ply_path, error);
      return absl::FailedPreconditionError(DescribeNothing(totals_, options_));
    }
    tell_joined(1);
    progress_.seconds_left = -1;
    Json texture;
    if (!IsPly(*format_)) {
      MW_ASSIGN_OR_RETURN(texture, WriteInFormat(ply_path));
    }
    Json report = MakeReport(counts, std::move(cameras));
    if (!texture.is_null()) report["texture"] = std::move(texture);
    if (settings_.add_to_report) MW_RETURN_IF_ERROR(settings_.add_to_report(ply_path, report));
    MW_RETURN_IF_ERROR(WriteRefinedCameras());
    MW_RETURN_IF_ERROR(WriteFileAtomically(settings_.report_path, JsonText(report, 2) + "\n"));
    if (!settings_.page_path.empty()) MW_RETURN_IF_ERROR(WritePage(ply_path, report));
    return report;
  }

  // For whatever is done next with mesh and photographs. Those of an earlier run would be taken for this one's.
  absl::Status WriteRefinedCameras() const {
    if (settings_.cameras_path.empty()) return absl::OkStatus();
    if (refinement_.moved()) {
      return WriteFileAtomically(settings_.cameras_path, EncodeCameraRefinement(refinement_) + "\n");
    }
    std::error_code error;
    fs::remove(settings_.cameras_path, error);
    return absl::OkStatus();
  }

  absl::Status WritePage(const std::string& ply_path, const Json& report) {
    Tell(LocalStage::kReporting, 0, 1);
    const ReportPageInput input = {.title = fs::path(settings_.output_path).filename().string(),
                                   .report = report,
                                   .scene = scene_,
                                   .ply_path = ply_path};
    MW_ASSIGN_OR_RETURN(const std::string page, MakeReportPage(input, pool_));
    MW_RETURN_IF_ERROR(WriteFileAtomically(settings_.page_path, page));
    Tell(LocalStage::kReporting, 1, 1);
    return absl::OkStatus();
  }

  // What is to be told of the texture; null when there is none.
  absl::StatusOr<Json> WriteInFormat(const std::string& ply_path) {
    if (!format_->textured || !settings_.texture.has_value()) {
      MW_RETURN_IF_ERROR(ConvertPly(ply_path, *format_, false, settings_.output_path, settings_.write));
      return Json();
    }
    MW_ASSIGN_OR_RETURN(TriangleMesh mesh, ReadPly(ply_path));
    const auto progress = [&](int done, int total) { Tell(LocalStage::kTexturing, done, total); };
    MW_ASSIGN_OR_RETURN(const TextureReport report,
                        WriteTexturedMesh(std::move(mesh), scene_, *settings_.texture, *format_, settings_.output_path,
                                          pool_, progress));
    return ToJson(report);
  }

  Json MakeReport(const JoinedMeshCounts& counts, Json cameras) const {
    const ProcessUsage usage = MeasureProcessUsage();
    Json report;
    report["program"] = absl::StrCat("meshwright ", kProgramVersion);
    report["mesh"] = {{"path", settings_.output_path},
                      {"vertices", counts.vertices},
                      {"faces", counts.faces},
                      {"patches_trimmed", counts.patches_trimmed},
                      {"border_edges_before", counts.border_edges_before},
                      {"border_edges_after", counts.border_edges_after},
                      {"stitch_faces", counts.stitch_faces},
                      {"holes_filled", counts.holes_filled},
                      {"hole_faces", counts.hole_faces},
                      {"closing_faces", counts.closing_faces},
                      {"components_removed", counts.components_removed},
                      {"faces_simplified", counts.faces_simplified},
                      {"area", counts.area}};
    report["scene"] = {{"format", scene_.format},
                       {"photographs", scene_.views.size()},
                       {"sparse_points", scene_.points.size()},
                       {"pairs", PairsToJson(loop_->conductor())}};
    report["scene"]["refinement"] = RefinementToJson(refinement_);
    // world = local + offset
    if (!scene_.offset.isZero(0)) report["scene"]["offset"] = {scene_.offset.x(), scene_.offset.y(), scene_.offset.z()};
    report["options"] = ToJson(options_);
    report["options"].erase("method");
    report["verdict"] = std::move(cameras["verdict"]);
    report["totals"] = std::move(cameras["totals"]);
    // Of this process; a resumed reconstruction's earlier processes took theirs.
    report["process"] = {{"threads", settings_.threads},
                         {"cameras_done_before", progress_.resumed_from},
                         {"wall_seconds", stopwatch_.Seconds()},
                         {"cpu_seconds", usage.cpu_seconds},
                         {"peak_memory_bytes", usage.peak_rss_bytes}};
    report["cameras"] = std::move(cameras["cameras"]);
    return report;
  }

  Scene scene_;  // with the cameras as they are refined
  const ReconstructionOptions& options_;
  const LocalSettings& settings_;
  const CameraJobFunction& job_;
  const ProgressListener& listener_;
  const Stopwatch stopwatch_;
  RealClock clock_;
  ThreadPool pool_{settings_.threads};
  std::vector<FileStamp> stamps_;  // of the photographs, before they were digested
  const MeshFormat* format_ = nullptr;
  std::vector<Camera> cameras_;
  std::unique_ptr<WorkFolder> work_;
  CameraRefinement refinement_;
  std::optional<LostBlobNamer> blobs_;  // of the work folder
  std::optional<HeldConductorLease> lease_;
  std::unique_ptr<OuterLoop> loop_;
  ReportTotals totals_;
  LocalProgress progress_;
};

}  // namespace

std::string NameOf(LocalStage stage) {
  switch (stage) {
    case LocalStage::kChecking:
      return "checking photographs";
    case LocalStage::kRefining:
      return "refining cameras";
    case LocalStage::kPairs:
      return "finding pairs";
    case LocalStage::kCameras:
      return "cameras";
    case LocalStage::kJudging:
      return "judging surfaces again";
    case LocalStage::kJoining:
      return "joining the mesh";
    case LocalStage::kTexturing:
      return "cutting textures";
    case LocalStage::kReporting:
      return "drawing the report";
  }
  return "";
}

int ConcurrentJobs(const ReconstructionOptions& options, int threads) {
  return std::max(1, std::min(options.conductor.window, threads));
}

absl::StatusOr<Json> ReconstructLocally(const Scene& scene, const ReconstructionOptions& options,
                                        const LocalSettings& settings, const CameraJobFunction& job,
                                        const ProgressListener& listener) {
  return LocalReconstruction(scene, options, settings, job, listener).Run();
}

}  // namespace meshwright
