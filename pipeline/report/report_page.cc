// SPDX-License-Identifier: Apache-2.0
#include "pipeline/report/report_page.h"

#include <algorithm>
#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include <absl/strings/ascii.h>
#include <absl/strings/escaping.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_replace.h>

#include "pipeline/report/mesh_pictures.h"
#include "pipeline/report/page_text.h"
#include "pipeline/report/report_style.h"
#include "pipeline/report/verdict.h"

#include "common/base/status_macros.h"
#include "common/image/encode.h"
#include "common/scene/view.h"

namespace meshwright {
namespace {

using Json = nlohmann::ordered_json;

constexpr int kThumbnailPx = 240;  // longest side
constexpr int kViewPx = 760;
constexpr int kJpegQuality = 72;
constexpr uint8_t kBackground = 128;          // fits a light page and a dark one
constexpr size_t kSampledVertices = 200'000;  // of the mesh, for what photographs see of it

std::string Picture(const ColorImage& image) {
  return absl::StrCat("data:image/jpeg;base64,", absl::Base64Escape(EncodeJpeg(image, kJpegQuality)));
}

// What is known of one photograph.
struct PhotographFacts {
  size_t view = 0;
  const Json* report = nullptr;  // of its camera; null: never processed
  double seen_share = 0;         // of it, in which the mesh is seen
  std::string thumbnail;         // "" when it cannot be read
  std::string unreadable;
};

std::string WithCapital(std::string text) {
  if (!text.empty()) text.front() = absl::ascii_toupper(static_cast<unsigned char>(text.front()));
  return text;
}

class Page {
 public:
  Page(const ReportPageInput& input, const MeshRows& mesh, ThreadPool& pool)
      : input_(input), report_(input.report), mesh_(mesh), pool_(pool) {}

  std::string Make() {
    LookAtPhotographs();
    AddHead();
    AddViews();
    AddRays();
    AddLosses();
    AddPhotographs();
    AddTimes();
    AddCameras();
    AddOptions();
    absl::StrAppend(&html_, "</main>\n</body>\n</html>\n");
    return std::move(html_);
  }

 private:
  void LookAtPhotographs() {
    std::map<std::string, const Json*> reports;
    for (const Json& camera : MemberOf(report_, "cameras")) reports[TextOf(camera, "name")] = &camera;
    const std::vector<SceneView>& views = input_.scene.views;
    const MeshSample sample = SampleMesh(mesh_, kSampledVertices);
    photographs_.resize(views.size());
    std::vector<SeenCells> cells(views.size());
    const auto for_each = [&](size_t count, const auto& body) {
      pool_.ParallelFor(static_cast<int64_t>(count), 1, [&](int64_t begin, int64_t end) {
        for (int64_t i = begin; i < end; ++i) body(static_cast<size_t>(i));
      });
    };
    for_each(views.size(), [&](size_t i) {
      cells[i] = FindSeenCells(sample, UndistortedCamera(views[i], kThumbnailPx));
      const auto found = reports.find(views[i].name);
      photographs_[i] = {
          .view = i, .report = found == reports.end() ? nullptr : found->second, .seen_share = cells[i].share()};
    });
    std::ranges::stable_sort(photographs_, {}, &PhotographFacts::seen_share);
    for_each(std::min(photographs_.size(), kMostPhotographs), [&](size_t i) {
      PhotographFacts& photograph = photographs_[i];
      absl::StatusOr<View> view = LoadView(views[photograph.view], kThumbnailPx);
      if (!view.ok()) {
        photograph.unreadable = std::string(view.status().message());
        return;
      }
      FadeUnseen(cells[photograph.view], view->color);
      photograph.thumbnail = Picture(view->color);
    });
  }

  void AddFact(const char* name, const std::string& value) {
    if (!value.empty()) absl::StrAppend(&html_, "<div><dt>", name, "</dt><dd>", EscapeHtml(value), "</dd></div>\n");
  }

  void AddHead() {
    absl::StrAppend(&html_,
                    "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
                    "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>",
                    EscapeHtml(input_.title), " – Meshwright</title>\n<style>", kReportStyle,
                    "</style>\n</head>\n<body>\n<main>\n<h1>", EscapeHtml(input_.title), "</h1>\n<p class=\"muted\">",
                    EscapeHtml(TextOf(report_, "program")), "</p>\n<section>\n<dl class=\"facts\">\n");
    const Json& mesh = MemberOf(report_, "mesh");
    const Json& scene = MemberOf(report_, "scene");
    const Json& totals = MemberOf(report_, "totals");
    const Json& process = MemberOf(report_, "process");
    AddFact("Vertices", CountOf(mesh, "vertices"));
    AddFact("Triangles", CountOf(mesh, "faces"));
    AddFact("Photographs", CountOf(scene, "photographs"));
    AddFact("Processed", CountOf(totals, "cameras_processed"));
    if (NumberOf(totals, "cameras_skipped") > 0) AddFact("Skipped", CountOf(totals, "cameras_skipped"));
    AddFact("Feasible pairs", CountOf(MemberOf(scene, "pairs"), "feasible"));
    AddFact("Took", SecondsOf(process, "wall_seconds"));
    AddFact("CPU", SecondsOf(process, "cpu_seconds"));
    AddFact("Memory at most", BytesOf(process, "peak_memory_bytes"));
    absl::StrAppend(&html_, "</dl>\n");
    AddVerdict();
    const Json& pairs = MemberOf(scene, "pairs");
    if (NumberOf(pairs, "cameras_without_pair") > 0) {
      absl::StrAppend(&html_, "<p class=\"small\">", CountOf(pairs, "cameras_without_pair"),
                      " photographs have no pair (from ", EscapeHtml(TextOf(pairs, "from")),
                      ") and contribute nothing.</p>\n");
    }
    absl::StrAppend(&html_, "</section>\n");
  }

  void AddVerdict() {
    const Json& verdict = MemberOf(report_, "verdict");
    if (!verdict.is_object() || verdict.empty()) return;
    for (const std::string& text : {DescribeVerdict(verdict), DescribeWarning(verdict)}) {
      if (!text.empty()) absl::StrAppend(&html_, "<p>", EscapeHtml(WithCapital(text)), ".</p>\n");
    }
  }

  // The camera that sees most of the mesh, and the one that looks most differently of those that see some of it.
  void AddViews() {
    if (photographs_.empty() || mesh_.faces() == 0 || !mesh_.has_colors()) return;
    const std::vector<SceneView>& views = input_.scene.views;
    const PhotographFacts& best = photographs_.back();
    const Eigen::Vector3d axis = UndistortedCamera(views[best.view], kViewPx).viewing_direction_in_world();
    const PhotographFacts* other = nullptr;
    double least = 2;
    for (const PhotographFacts& photograph : photographs_) {
      if (&photograph == &best || photograph.seen_share < 0.5 * best.seen_share) continue;
      const double cosine = axis.dot(UndistortedCamera(views[photograph.view], kViewPx).viewing_direction_in_world());
      if (cosine >= least) continue;
      least = cosine;
      other = &photograph;
    }
    absl::StrAppend(&html_, "<section>\n<h2>The mesh</h2>\n<div class=\"views\">\n");
    for (const PhotographFacts* photograph : {&best, other}) {
      if (photograph == nullptr) continue;
      const SceneView& view = views[photograph->view];
      absl::StrAppend(&html_, "<figure><img alt=\"The mesh from ", EscapeHtml(view.name), "\" src=\"",
                      Picture(DrawMesh(mesh_, UndistortedCamera(view, kViewPx), kBackground)),
                      "\"><figcaption>as the camera of ", EscapeHtml(view.name), " sees it</figcaption></figure>\n");
    }
    absl::StrAppend(&html_, "</div>\n</section>\n");
  }

  void AddRays() {
    const Json& totals = MemberOf(report_, "totals");
    const RayShares shares = SharesOf(NumberOf(totals, "share_covered_before"), NumberOf(totals, "share_grown"),
                                      NumberOf(totals, "share_accepted"));
    absl::StrAppend(&html_, "<section>\n<h2>Where the rays went</h2>\n", Bar(shares, ""), "<div class=\"key\">\n");
    const auto key = [&](const char* name, const char* words, double share) {
      absl::StrAppendFormat(&html_, "<span><i class=\"%s\"></i>%.1f %% %s</span>\n", name, 100 * share, words);
    };
    key("covered", "showed surface that was accepted before", shares.covered);
    key("accepted", "gave surface that was accepted", shares.accepted);
    key("unconfirmed", "gave surface that no other camera confirmed", shares.unconfirmed);
    key("empty", "gave none", shares.empty);
    absl::StrAppend(&html_, "</div>\n");
    const Json& mesh = MemberOf(report_, "mesh");
    if (mesh.contains("patches_trimmed")) {
      absl::StrAppend(&html_, "<p class=\"small muted\" style=\"margin-top:12px\">Of ", CountOf(totals, "rays"),
                      " rays ", CountOf(totals, "rays_grown"), " were grown, ", CountOf(totals, "rays_filtered"),
                      " came through filtering, ", CountOf(totals, "rays_accepted"), " were accepted. In joining ",
                      CountOf(mesh, "patches_trimmed"), " patches went where an earlier surface shows the same, and ",
                      CountOf(mesh, "components_removed"), " small pieces were left out; ",
                      CountOf(mesh, "holes_filled"), " holes were closed, ", CountOf(mesh, "border_edges_after"),
                      " edges of the mesh are open.</p>\n");
    }
    absl::StrAppend(&html_, "</section>\n");
  }

  // Only where the true surface was given.
  void AddLosses() {
    const Json& losses = MemberOf(report_, "losses");
    if (losses.empty()) return;
    absl::StrAppend(&html_, "<section>\n<h2>What was lost, against the true surface</h2>\n<table>\n");
    const double pixels = NumberOf(losses, "ground_truth_pixels");
    const auto row = [&](const std::string& name, const Json& value) {
      if (!value.is_number()) return;
      absl::StrAppendFormat(&html_, "<tr><td>%s</td><td>%s</td><td>%.2f %%</td></tr>\n",
                            EscapeHtml(absl::StrReplaceAll(name, {{"_", " "}})), FormatWhole(value.get<double>()),
                            pixels > 0 ? 100 * value.get<double>() / pixels : 0.0);
    };
    for (const auto& [name, value] : losses.items()) {
      row(name, value);
      if (!value.is_object()) continue;
      for (const auto& [stage, count] : value.items()) row(stage, count);
    }
    absl::StrAppend(&html_, "</table>\n</section>\n");
  }

  void AddPhotographs() {
    absl::StrAppend(&html_,
                    "<section>\n<h2>Photographs</h2>\n<p class=\"muted small\">Those that see least of the mesh first. "
                    "Where a photograph is in colour the mesh is seen in it; the line says where its own rays went.");
    const size_t shown = std::min(photographs_.size(), kMostPhotographs);
    if (shown < photographs_.size()) {
      absl::StrAppend(&html_, " ", shown, " of ", photographs_.size(), " are shown.");
    }
    absl::StrAppend(&html_, "</p>\n<div class=\"photographs\">\n");
    for (size_t i = 0; i < shown; ++i) AddPhotograph(photographs_[i]);
    absl::StrAppend(&html_, "</div>\n</section>\n");
  }

  void AddPhotograph(const PhotographFacts& photograph) {
    const std::string name = EscapeHtml(input_.scene.views[photograph.view].name);
    absl::StrAppend(&html_, "<div class=\"photograph\">");
    if (!photograph.thumbnail.empty()) {
      absl::StrAppend(&html_, "<img loading=\"lazy\" alt=\"\" src=\"", photograph.thumbnail, "\">");
    }
    absl::StrAppend(&html_, "<h3 title=\"", name, "\">", name, "</h3>");
    if (photograph.report != nullptr && !photograph.report->contains("skipped")) {
      const Json& shares = MemberOf(*photograph.report, "shares");
      absl::StrAppend(&html_, Bar(SharesOf(NumberOf(shares, "covered_before"), NumberOf(shares, "grown"),
                                           NumberOf(shares, "accepted")),
                                  " thin"));
    }
    absl::StrAppendFormat(&html_, "<p class=\"muted\">mesh in %.0f %% of it</p>", 100 * photograph.seen_share);
    if (photograph.report == nullptr) absl::StrAppend(&html_, "<p class=\"danger\">not processed: no pair</p>");
    if (photograph.report != nullptr && photograph.report->contains("skipped")) {
      absl::StrAppend(&html_, "<p class=\"danger\">skipped: ", EscapeHtml(TextOf(*photograph.report, "skipped")),
                      "</p>");
    }
    if (!photograph.unreadable.empty()) {
      absl::StrAppend(&html_, "<p class=\"danger\">", EscapeHtml(photograph.unreadable), "</p>");
    }
    absl::StrAppend(&html_, "</div>\n");
  }

  void AddTimes() {
    std::vector<std::pair<std::string, double>> stages;
    double all = 0;
    for (const Json& camera : MemberOf(report_, "cameras")) {
      for (const auto& [stage, value] : MemberOf(camera, "seconds").items()) {
        if (!value.is_number()) continue;
        auto found = std::ranges::find(stages, stage, [](const auto& one) { return one.first; });
        if (found == stages.end()) found = stages.insert(stages.end(), {stage, 0.0});
        found->second += value.get<double>();
        all += value.get<double>();
      }
    }
    if (!(all > 0)) return;
    absl::StrAppend(&html_,
                    "<section>\n<h2>Times</h2>\n<p class=\"muted small\">Seconds of the camera jobs by stage; jobs run "
                    "at the same time.</p>\n<table>\n");
    for (const auto& [stage, seconds] : stages) {
      absl::StrAppendFormat(&html_,
                            "<tr><td>%s</td><td>%.1f s</td><td style=\"width:50%%\"><div class=\"bar thin\"><span "
                            "class=\"covered\" style=\"width:%.1f%%\"></span></div></td></tr>\n",
                            EscapeHtml(stage), seconds, 100 * seconds / all);
    }
    absl::StrAppend(&html_, "</table>\n</section>\n");
  }

  void AddCameras() {
    const Json& cameras = MemberOf(report_, "cameras");
    if (cameras.empty()) return;
    absl::StrAppend(
        &html_,
        "<section>\n<details><summary>Cameras in the order of processing</summary>\n<div class=\"scroll\">"
        "<table>\n<tr><th>photograph</th><th>neighbours</th><th>compared with</th><th>seeds</th>"
        "<th>covered before</th><th>grown</th><th>filtered</th><th>accepted</th><th>weak pairs</th></tr>\n");
    for (const Json& camera : cameras) {
      const Json& shares = MemberOf(camera, "shares");
      const auto percent = [&](const char* name) { return absl::StrFormat("%.1f %%", 100 * NumberOf(shares, name)); };
      absl::StrAppend(&html_, "<tr><td>", EscapeHtml(TextOf(camera, "name")), "</td><td>",
                      CountOf(camera, "neighbours"), "</td><td>", MemberOf(camera, "targets").size(), "</td><td>",
                      CountOf(camera, "seeds"), "</td><td>", percent("covered_before"), "</td><td>", percent("grown"),
                      "</td><td>", percent("filtered"), "</td><td>", percent("accepted"), "</td><td>",
                      MemberOf(camera, "weak_targets").size(), "</td></tr>\n");
    }
    absl::StrAppend(&html_, "</table></div>\n</details>\n</section>\n");
  }

  void AddOptions() {
    const Json& options = MemberOf(report_, "options");
    if (options.empty()) return;
    absl::StrAppend(&html_, "<section>\n<details><summary>Options</summary>\n<table>\n");
    for (const auto& [name, value] : options.items()) {
      absl::StrAppend(&html_, "<tr><td>", EscapeHtml(name), "</td><td>", EscapeHtml(ValueText(value)), "</td></tr>\n");
    }
    absl::StrAppend(&html_, "</table>\n</details>\n</section>\n");
  }

  const ReportPageInput& input_;
  const Json& report_;
  const MeshRows& mesh_;
  ThreadPool& pool_;
  std::vector<PhotographFacts> photographs_;  // by seen_share, ascending
  std::string html_;
};

}  // namespace

absl::StatusOr<std::string> MakeReportPage(const ReportPageInput& input, ThreadPool& pool) {
  MW_ASSIGN_OR_RETURN(const MeshRows mesh, MeshRows::OpenPly(input.ply_path));
  return Page(input, mesh, pool).Make();
}

}  // namespace meshwright
