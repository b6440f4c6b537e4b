// SPDX-License-Identifier: Apache-2.0
#include "pipeline/cameras/estimate_cameras.h"

#include <algorithm>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <iterator>
#include <memory>
#include <set>
#include <system_error>
#include <utility>

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_join.h>
#include <absl/time/time.h>
#include <nlohmann/json.hpp>

#include "pipeline/cameras/camera_groups.h"
#include "pipeline/cameras/child_process.h"
#include "pipeline/cameras/colmap_database.h"
#include "pipeline/cameras/feature_matching.h"
#include "pipeline/cameras/photograph_folder.h"

#include "common/base/bad_input.h"
#include "common/base/files.h"
#include "common/base/folder_lock.h"
#include "common/base/status_macros.h"
#include "common/base/thread_pool.h"
#include "common/base/utf8.h"
#include "common/json/json_text.h"
#include "common/scene/formats/import.h"

namespace meshwright {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr char kNotInstalled[] =
    "COLMAP is not installed; it estimates the cameras of photographs: apt-get install colmap";
constexpr int64_t kFewFeatures = 100;  // of a photograph: hardly anything to hold on to
constexpr int64_t kLongestLogBytes = 64 << 20;
constexpr double kWellRegistered = 0.7;  // of the photographs

// Shares of the time, for one bar.
constexpr double kShareBefore[kCameraSteps + 1] = {0, 0.02, 0.4, 0.41, 0.5, 0.6, 1};

absl::Status SystemError(const fs::path& path, const char* what, const std::error_code& error) {
  const std::string message = absl::StrCat(path.string(), ": ", what, ": ", error.message());
  if (error == std::errc::no_space_on_device) return absl::ResourceExhaustedError(message);
  return absl::PermissionDeniedError(message);
}

// How photographs are better taken; every failure of theirs ends in it.
constexpr char kHowToPhotograph[] =
    "walk around the thing and take a sharp picture every 5 to 15 degrees, each spot in at least three of them, with "
    "the "
    "same zoom, moving the camera and not only turning it";

// Appends everything to a file that people can read later, up to a limit: COLMAP may print without end.
class Log {
 public:
  explicit Log(const std::string& path) : file_(std::fopen(path.c_str(), "a")) {}
  Log(const Log&) = delete;
  Log& operator=(const Log&) = delete;
  ~Log() {
    if (file_ != nullptr) std::fclose(file_);
  }
  void Write(const std::string& line) {
    if (file_ == nullptr || written_ > kLongestLogBytes) return;
    written_ += static_cast<int64_t>(line.size()) + 1;
    std::fprintf(file_, "%s\n", line.c_str());
    std::fflush(file_);
  }

 private:
  std::FILE* file_;
  int64_t written_ = 0;
};

// How many images a model's images.bin says it holds; 0: none, or not such a file.
uint64_t RegisteredImages(const fs::path& model) {
  uint64_t count = 0;
  if (std::FILE* const file = std::fopen((model / "images.bin").c_str(), "rb"); file != nullptr) {
    if (std::fread(&count, sizeof(count), 1, file) != 1) count = 0;
    std::fclose(file);
  }
  return count;
}

class Estimation {
 public:
  Estimation(const CameraEstimationSettings& settings, const Clock& clock, const CameraProgressListener& listener)
      : settings_(settings),
        clock_(clock),
        listener_(listener),
        scene_(fs::path(settings.scene_folder)),
        work_(scene_ / "colmap") {}

  absl::StatusOr<CameraEstimate> Run() {
    MW_ASSIGN_OR_RETURN(photographs_, ListPhotographs(settings_.photographs));
    MW_ASSIGN_OR_RETURN(const std::string version, FindColmap(settings_.program));
    MW_RETURN_IF_ERROR(Check());
    MW_RETURN_IF_ERROR(OpenFolder());
    if (!IsDone("scene")) {
      Say(absl::StrCat("cameras of ", photographs_.photographs.size(), " photographs are estimated with COLMAP ",
                       version, "; its log is ", LogPath()));
      MW_RETURN_IF_ERROR(Prepare());
      if (!IsDone("features")) MW_RETURN_IF_ERROR(FindFeatures());
      if (!IsDone("matches")) MW_RETURN_IF_ERROR(Match());
      if (!IsDone("pairs")) MW_RETURN_IF_ERROR(Verify());
      MW_RETURN_IF_ERROR(Map());
      MW_RETURN_IF_ERROR(Publish());
    }
    return Summarize();
  }

 private:
  std::string Database() const { return (work_ / "database.db").string(); }
  std::string LogPath() const { return (work_ / "log.txt").string(); }
  fs::path StatePath() const { return work_ / "state.json"; }
  fs::path Models() const { return work_ / "sparse"; }
  int Count() const { return static_cast<int>(photographs_.photographs.size()); }

  void Say(const std::string& line) const {
    if (settings_.say) settings_.say(line);
  }

  void Tell(CameraStep step, int done, int total, double seconds_left) const {
    const auto index = static_cast<size_t>(step);
    const double share = total > 0 ? static_cast<double>(done) / total : 0;
    const double fraction = kShareBefore[index] + share * (kShareBefore[index + 1] - kShareBefore[index]);
    listener_({.step = step, .done = done, .total = total, .fraction = fraction, .seconds_left = seconds_left});
  }

  bool Stopped() const { return settings_.stop && settings_.stop(); }

  absl::Status Check() {
    ThreadPool pool(settings_.threads);
    Tell(CameraStep::kChecking, 0, Count(), -1);
    const int count = Count();
    MW_RETURN_IF_ERROR(
        CheckPhotographs(&photographs_, pool, [&](int checked) { Tell(CameraStep::kChecking, checked, count, -1); }));
    if (Stopped()) return absl::CancelledError("stopped");
    for (const std::string& note : photographs_.notes) Say(note);
    chosen_ = ChoosePairs(photographs_.photographs);
    if (settings_.pairs.has_value()) chosen_ = {*settings_.pairs, "as asked for"};
    return absl::OkStatus();
  }

  // What the cameras are a function of.
  Json Inputs() const {
    return {{"photographs", photographs_.digest},
            {"pairs", NameOf(chosen_.selection)},
            {"max_features", settings_.max_features},
            {"max_image_size", settings_.max_image_size}};
  }

  absl::Status OpenFolder() {
    std::error_code error;
    if (fs::exists(scene_, error) && !fs::exists(StatePath(), error) && fs::exists(scene_ / "sparse", error)) {
      return absl::FailedPreconditionError(
          absl::StrCat(scene_.string(), ": holds sparse/ that is not from here; name another folder"));
    }
    fs::create_directories(work_, error);
    if (error) return SystemError(work_, "cannot make the folder", error);
    MW_ASSIGN_OR_RETURN(lock_, FolderLock::Acquire(work_.string()));
    const absl::StatusOr<std::string> text = ReadFile(StatePath().string());
    state_ = text.ok() ? Json::parse(*text, nullptr, false) : Json();
    const bool same = state_.is_object() && state_.value("inputs", Json()) == Inputs();
    if (same) return absl::OkStatus();
    if (state_.is_object() && !settings_.restart) {
      return absl::FailedPreconditionError(
          absl::StrCat(scene_.string(),
                       ": holds cameras of other photographs or settings; name another folder, or begin anew with "
                       "--restart"));
    }
    return BeginAnew();
  }

  absl::Status BeginAnew() {
    std::error_code error;
    std::vector<fs::path> old = {scene_ / "sparse"};
    for (const auto& entry : fs::directory_iterator(work_, error)) {
      if (entry.path().filename() != FolderLock::kFileName) old.push_back(entry.path());
    }
    for (const fs::path& path : old) {
      fs::remove_all(path, error);
      if (error) return SystemError(path, "cannot be removed", error);
    }
    state_ = {{"inputs", Inputs()}, {"done", Json::array()}};
    return WriteFileAtomically(StatePath().string(), JsonText(state_, 2) + "\n");
  }

  bool IsDone(const char* step) const {
    const Json done = state_.value("done", Json::array());
    return std::find(done.begin(), done.end(), Json(step)) != done.end();
  }

  absl::Status MarkDone(const char* step) {
    state_["done"].push_back(step);
    return WriteFileAtomically(StatePath().string(), JsonText(state_, 2) + "\n");
  }

  // Names without spaces, in natural order, under which COLMAP sees photographs and masks: its lists of pairs are split
  // at spaces.
  std::string PlainName(size_t photograph) const {
    return absl::StrFormat("%06d%s", photograph + 1,
                           fs::path(photographs_.photographs[photograph].name).extension().string());
  }

  absl::Status LinkTo(const fs::path& target, const fs::path& link) const {
    std::error_code error;
    fs::remove(link, error);
    fs::create_symlink(fs::absolute(target), link, error);
    if (error) return SystemError(link, "cannot make the link", error);
    return absl::OkStatus();
  }

  absl::Status Prepare() {
    std::error_code error;
    for (const char* folder : {"photographs", "masks"}) {
      fs::create_directories(work_ / folder, error);
      if (error) return SystemError(work_ / folder, "cannot make the folder", error);
    }
    for (size_t i = 0; i < photographs_.photographs.size(); ++i) {
      const Photograph& photograph = photographs_.photographs[i];
      MW_RETURN_IF_ERROR(LinkTo(photograph.path, work_ / "photographs" / PlainName(i)));
      if (photograph.mask_path.empty()) continue;
      has_masks_ = true;
      MW_RETURN_IF_ERROR(LinkTo(photograph.mask_path, work_ / "masks" / (PlainName(i) + ".png")));
    }
    if (IsDone("pairs")) return absl::OkStatus();
    if (!fs::exists(Database(), error)) {
      MW_RETURN_IF_ERROR(RunColmap(CameraStep::kFeatures, {"database_creator", "--database_path", Database()}));
    }
    return PutPhotographs([&](size_t i) { return PlainName(i); });
  }

  absl::Status PutPhotographs(const std::function<std::string(size_t photograph)>& name) {
    const std::vector<CameraGroup> groups = GroupByCamera(photographs_.photographs);
    std::vector<std::string> names;
    for (size_t i = 0; i < photographs_.photographs.size(); ++i) names.push_back(name(i));
    MW_ASSIGN_OR_RETURN(const auto database, ColmapDatabase::Open(Database()));
    return database->PutPhotographs(groups, names);
  }

  void SayGroups() const {
    const std::vector<CameraGroup> groups = GroupByCamera(photographs_.photographs);
    size_t without_focal = 0;
    for (const CameraGroup& group : groups) without_focal += group.focal_from_exif ? 0 : group.photographs.size();
    const auto masks = std::count_if(photographs_.photographs.begin(), photographs_.photographs.end(),
                                     [](const Photograph& photograph) { return !photograph.mask_path.empty(); });
    Say(absl::StrCat(groups.size(), groups.size() == 1 ? " camera" : " cameras", " by EXIF, folder and size; ",
                     without_focal, " photographs do not tell their focal length; ", masks, " have a mask"));
  }

  absl::Status FindFeatures() {
    SayGroups();
    std::vector<std::string> arguments = {"feature_extractor",
                                          "--database_path",
                                          Database(),
                                          "--image_path",
                                          (work_ / "photographs").string(),
                                          "--SiftExtraction.use_gpu",
                                          "0",
                                          "--SiftExtraction.num_threads",
                                          kThreads,
                                          "--SiftExtraction.max_image_size",
                                          absl::StrCat(settings_.max_image_size),
                                          "--SiftExtraction.max_num_features",
                                          absl::StrCat(settings_.max_features)};
    if (has_masks_) {
      arguments.insert(arguments.end(), {"--ImageReader.mask_path", (work_ / "masks").string()});
    }
    MW_RETURN_IF_ERROR(RunColmap(CameraStep::kFeatures, arguments));
    MW_RETURN_IF_ERROR(CheckFeatures());
    return MarkDone("features");
  }

  absl::Status CheckFeatures() {
    MW_ASSIGN_OR_RETURN(const auto database, ColmapDatabase::Open(Database()));
    MW_ASSIGN_OR_RETURN(const std::vector<int64_t> features, database->CountFeatures());
    const auto with_few = static_cast<size_t>(
        std::count_if(features.begin(), features.end(), [](int64_t count) { return count < kFewFeatures; }));
    if (features.size() < 3 + with_few) {
      return absl::FailedPreconditionError(absl::StrCat(
          settings_.photographs, ": ", with_few, " of ", features.size(),
          " photographs have next to no features (fewer than ", kFewFeatures,
          "): they are dark, blurred, or show surfaces without texture; light the thing evenly, focus, put "
          "textured things beside it, and ",
          kHowToPhotograph));
    }
    return absl::OkStatus();
  }

  absl::Status Match() {
    Say(absl::StrCat("photographs are compared ", chosen_.reason, " (", NameOf(chosen_.selection), ")"));
    ThreadPool pool(settings_.threads);
    MW_ASSIGN_OR_RETURN(const auto database, ColmapDatabase::Open(Database()));
    std::vector<ImagePair> pairs = PairsByNumber(chosen_.selection, Count());
    if (const size_t similar = SimilarPerPhotograph(chosen_.selection); similar > 0) {
      MW_ASSIGN_OR_RETURN(const std::vector<ImagePair> alike,
                          FindSimilarPairs(*database, Count(), similar, pool, MatchingListener(CameraStep::kPairing)));
      std::vector<ImagePair> both;
      std::ranges::set_union(pairs, alike, std::back_inserter(both));
      pairs = std::move(both);
    }
    MW_RETURN_IF_ERROR(MatchPairs(*database, pairs, pool, MatchingListener(CameraStep::kMatching)));
    return MarkDone("matches");
  }

  MatchingProgress MatchingListener(CameraStep step) const {
    return [this, step, started = clock_.Now(), before = int64_t{-1}](int64_t done, int64_t total) mutable {
      if (before < 0) before = done;
      const double seconds = absl::ToDoubleSeconds(clock_.Now() - started);
      const double left =
          done > before ? seconds / static_cast<double>(done - before) * static_cast<double>(total - done) : -1;
      Tell(step, static_cast<int>(done), static_cast<int>(total), left);
      return !Stopped();
    };
  }

  absl::Status Verify() {
    PairCounts counts;
    {
      MW_ASSIGN_OR_RETURN(const auto database, ColmapDatabase::Open(Database()));
      MW_ASSIGN_OR_RETURN(const std::string pairs, database->StartVerification());
      if (pairs.empty()) return NothingOverlaps(PairCounts());
      MW_RETURN_IF_ERROR(WriteFileAtomically((work_ / "pairs.txt").string(), pairs));
    }
    MW_RETURN_IF_ERROR(RunColmap(
        CameraStep::kVerifying,
        {"matches_importer", "--database_path", Database(), "--match_list_path", (work_ / "pairs.txt").string(),
         "--match_type", "pairs", "--SiftMatching.use_gpu", "0", "--SiftMatching.num_threads", "1"}));
    MW_ASSIGN_OR_RETURN(const auto database, ColmapDatabase::Open(Database()));
    MW_ASSIGN_OR_RETURN(counts, database->CountPairs());
    if (counts.verified == 0) return NothingOverlaps(counts);
    return MarkDone("pairs");
  }

  absl::Status NothingOverlaps(const PairCounts& counts) const {
    return absl::FailedPreconditionError(
        absl::StrCat(settings_.photographs, ": no two of the ", Count(), " photographs show the same surface (",
                     counts.matched, " pairs look alike, none fits one motion of the camera); ", kHowToPhotograph));
  }

  absl::Status Map() {
    // In the model the photographs have their own names.
    MW_RETURN_IF_ERROR(PutPhotographs([&](size_t i) { return photographs_.photographs[i].name; }));
    bool found = false;
    MW_ASSIGN_OR_RETURN(found, RunMapper({}));
    if (!found) {
      Say("no pair of photographs to begin with; trying once more with less strict limits");
      MW_ASSIGN_OR_RETURN(found, RunMapper({"--Mapper.init_min_tri_angle", "8", "--Mapper.init_min_num_inliers", "50",
                                            "--Mapper.abs_pose_min_num_inliers", "20"}));
    }
    return found ? absl::OkStatus() : NoModel();
  }

  // False: no model came out of it, which COLMAP calls a failure.
  absl::StatusOr<bool> RunMapper(const std::vector<std::string>& more) {
    std::error_code error;
    fs::remove_all(Models(), error);
    fs::create_directories(Models(), error);
    if (error) return SystemError(Models(), "cannot make the folder", error);
    std::vector<std::string> arguments = {"mapper",          "--database_path",      Database(),
                                          "--image_path",    settings_.photographs,  "--output_path",
                                          Models().string(), "--Mapper.num_threads", "1"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const absl::Status ran = RunColmap(CameraStep::kMapping, arguments);
    if (fs::exists(Models() / "0" / "images.bin", error)) return ran.ok() ? absl::StatusOr<bool>(true) : ran;
    if (ran.ok() || no_initial_pair_) return false;
    return ran;
  }

  absl::Status NoModel() const {
    MW_ASSIGN_OR_RETURN(const auto database, ColmapDatabase::Open(Database()));
    MW_ASSIGN_OR_RETURN(const PairCounts counts, database->CountPairs());
    return absl::FailedPreconditionError(absl::StrCat(
        settings_.photographs, ": ", counts.verified, " pairs of ", Count(),
        " photographs overlap, but no two show the same surface from places far enough apart to begin with; ",
        kHowToPhotograph));
  }

  // The largest model becomes sparse/0, and all of them the scene's.
  absl::Status Publish() {
    std::error_code error;
    size_t best = 0;
    for (size_t i = 1; fs::exists(Models() / std::to_string(i), error); ++i) {
      if (RegisteredImages(Models() / std::to_string(i)) > RegisteredImages(Models() / std::to_string(best))) best = i;
    }
    if (best != 0) {
      const fs::path aside = Models() / "largest";
      fs::rename(Models() / std::to_string(best), aside, error);
      if (!error) fs::rename(Models() / "0", Models() / std::to_string(best), error);
      if (!error) fs::rename(aside, Models() / "0", error);
      if (error) return SystemError(Models(), "cannot rename a model", error);
    }
    fs::remove_all(scene_ / "sparse", error);
    if (!error) fs::rename(Models(), scene_ / "sparse", error);
    if (error) return SystemError(scene_ / "sparse", "cannot be made", error);
    const fs::path images = scene_ / "images";
    // Photographs in images/ of the very scene need no link.
    if (!fs::equivalent(images, settings_.photographs, error))
      MW_RETURN_IF_ERROR(LinkTo(settings_.photographs, images));
    MW_RETURN_IF_ERROR(MarkDone("scene"));
    for (const char* name : {"database.db", "pairs.txt", "photographs", "masks"}) {
      fs::remove_all(work_ / name, error);  // large, and of no more use
    }
    return absl::OkStatus();
  }

  absl::StatusOr<CameraEstimate> Summarize() const {
    MW_ASSIGN_OR_RETURN(const Scene scene, ImportScene(scene_.string()));
    CameraEstimate estimate{.photographs = Count(), .registered = static_cast<int>(scene.views.size())};
    std::set<std::string> registered;
    for (const SceneView& view : scene.views) registered.insert(view.name);
    std::vector<std::string> missing;
    for (const Photograph& photograph : photographs_.photographs) {
      if (registered.count(ToUtf8(photograph.name)) == 0) missing.push_back(ToUtf8(photograph.name));
    }
    estimate.registered_names.assign(registered.begin(), registered.end());
    std::error_code error;
    for (int i = 1; fs::exists(scene_ / "sparse" / std::to_string(i), error); ++i) {
      const auto photographs = RegisteredImages(scene_ / "sparse" / std::to_string(i));
      estimate.notes.push_back(absl::StrCat(photographs, " photographs form a reconstruction of their own (",
                                            (scene_ / "sparse").string(), "/", i,
                                            ") and are not used: take photographs between them and the others"));
    }
    if (!missing.empty()) {
      constexpr size_t kNamed = 5;
      const size_t named = std::min(missing.size(), kNamed);
      const std::vector<std::string> first(missing.begin(), missing.begin() + static_cast<std::ptrdiff_t>(named));
      estimate.notes.push_back(
          absl::StrCat(missing.size(), " of ", Count(), " photographs got no camera: ", absl::StrJoin(first, ", "),
                       missing.size() > named ? ", ..." : "", "; they share too little with the others"));
    }
    if (estimate.registered < kWellRegistered * estimate.photographs) {
      estimate.notes.push_back(absl::StrCat("few photographs got a camera: ", kHowToPhotograph));
    }
    return estimate;
  }

  absl::Status RunColmap(CameraStep step, const std::vector<std::string>& arguments) {
    int threads = settings_.threads;
    while (true) {
      MW_ASSIGN_OR_RETURN(const ChildExit exit, RunOnce(step, arguments, threads));
      if (exit.ok()) return absl::OkStatus();
      // The kernel's doing, mostly: memory goes with the threads.
      if (exit.signal == SIGKILL && threads > 1) {
        threads /= 2;
        Say(absl::StrCat("COLMAP was killed, probably since memory ran out; again with ", threads, " threads"));
        continue;
      }
      return BrokeDown(arguments.front(), exit);
    }
  }

  absl::Status BrokeDown(const std::string& command, const ChildExit& exit) const {
    const std::string how =
        exit.signal != 0 ? absl::StrCat("was ended by signal ", exit.signal, exit.signal == SIGKILL ? " (memory?)" : "")
                         : absl::StrCat("ended with exit code ", exit.code);
    return absl::InternalError(absl::StrCat("colmap ", command, " ", how, trouble_.empty() ? "" : ": ", trouble_,
                                            "; all that it said is in ", LogPath()));
  }

  absl::StatusOr<ChildExit> RunOnce(CameraStep step, const std::vector<std::string>& arguments, int threads) {
    std::vector<std::string> command;
    // A pipe would hold lines back until there are many.
    if (!FindProgram("stdbuf").empty()) command = {"stdbuf", "-oL", "-eL"};
    command.push_back(settings_.program);
    for (const std::string& argument : arguments) {
      command.push_back(argument == kThreads ? absl::StrCat(threads) : argument);
    }
    Log log(LogPath());
    log.Write(absl::StrCat("$ ", absl::StrJoin(command, " ")));
    ColmapOutput output(step, Count());
    const absl::Time started = clock_.Now();
    int done_at_start = -1;
    no_initial_pair_ = false;
    Tell(step, 0, 0, -1);
    const auto on_line = [&](const std::string& line) {
      log.Write(line);
      if (absl::StrContains(line, "No good initial image pair") || absl::StrContains(line, "No images with matches")) {
        no_initial_pair_ = true;
      }
      if (!output.Read(line)) return;
      // What was done before, and is only skipped now, says nothing of the speed.
      if (done_at_start < 0) done_at_start = output.done() - 1;
      const double seconds = absl::ToDoubleSeconds(clock_.Now() - started);
      const int done_now = std::max(1, output.done() - done_at_start);
      Tell(step, output.done(), output.total(), seconds / done_now * (output.total() - output.done()));
    };
    absl::StatusOr<ChildExit> exit = RunChild(command, on_line, settings_.stop);
    trouble_ = output.trouble();
    return exit;
  }

  static constexpr char kThreads[] = "THREADS";  // stands for the number, which may have to be lowered

  const CameraEstimationSettings& settings_;
  const Clock& clock_;
  const CameraProgressListener& listener_;
  const fs::path scene_;
  const fs::path work_;
  std::optional<FolderLock> lock_;
  PhotographFolder photographs_;
  ChosenPairs chosen_;
  Json state_;
  bool has_masks_ = false;
  bool no_initial_pair_ = false;
  std::string trouble_;
};

}  // namespace

absl::StatusOr<std::string> FindColmap(const std::string& program) {
  if (FindProgram(program).empty()) return absl::FailedPreconditionError(kNotInstalled);
  std::string version;
  const auto on_line = [&](const std::string& line) {
    if (version.empty() && absl::StartsWith(line, "COLMAP ")) version = line.substr(7, line.find(' ', 7) - 7);
  };
  const Stopwatch stopwatch;
  const absl::StatusOr<ChildExit> exit =
      RunChild({program, "help"}, on_line, [&] { return stopwatch.Elapsed() > absl::Seconds(30); });
  if (absl::IsCancelled(exit.status())) {
    return absl::FailedPreconditionError(absl::StrCat(FindProgram(program), ": does not answer"));
  }
  if (!exit.ok()) return exit.status();
  int major = 0;
  int minor = 0;
  if (!exit->ok() || std::sscanf(version.c_str(), "%d.%d", &major, &minor) != 2) {
    return absl::FailedPreconditionError(absl::StrCat(FindProgram(program), ": does not answer as COLMAP does"));
  }
  if (major != 3 || minor < 6 || minor > 11) {
    return absl::FailedPreconditionError(
        absl::StrCat(FindProgram(program), ": COLMAP ", version, "; expected 3.6 to 3.11"));
  }
  return version;
}

absl::StatusOr<CameraEstimate> EstimateCameras(const CameraEstimationSettings& settings, const Clock& clock,
                                               const CameraProgressListener& listener) {
  return Estimation(settings, clock, listener).Run();
}

}  // namespace meshwright
