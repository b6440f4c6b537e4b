// SPDX-License-Identifier: Apache-2.0
#include "pipeline/report/report_page.h"

#include <array>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include <absl/strings/str_cat.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "pipeline/report/mesh_pictures.h"
#include "pipeline/report/page_text.h"

#include "common/base/check.h"
#include "common/image/encode.h"
#include "common/mesh/ply.h"
#include "common/scene/view.h"

namespace meshwright {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::Not;
using Json = nlohmann::ordered_json;

// A wall of 2 x 2 at depth `depth` that faces the cameras, in one colour.
void AddWall(float depth, std::array<uint8_t, 3> color, TriangleMesh& mesh) {
  constexpr int kSide = 41;
  const auto first = static_cast<uint32_t>(mesh.positions.size());
  for (int row = 0; row < kSide; ++row) {
    for (int column = 0; column < kSide; ++column) {
      mesh.positions.emplace_back(column * 0.05F - 1, row * 0.05F - 1, depth);
      mesh.normals.emplace_back(0, 0, -1);
      mesh.colors.push_back(color);
    }
  }
  for (int row = 0; row + 1 < kSide; ++row) {
    for (int column = 0; column + 1 < kSide; ++column) {
      const uint32_t corner = first + static_cast<uint32_t>(row * kSide + column);
      mesh.faces.push_back({corner, corner + 1, corner + kSide});
      mesh.faces.push_back({corner + 1, corner + kSide + 1, corner + kSide});
    }
  }
}

// Three photographs: "near" is filled by a wall, "far" has it in its middle, "away" looks the other way.
class ReportPageTest : public testing::Test {
 protected:
  ReportPageTest()
      : folder_(fs::path(testing::TempDir()) / ("meshwright_report_page_test_" + std::to_string(::getpid()))) {
    fs::create_directories(folder_);
    AddView("near <b>", 0, 1);
    AddView("far", 3, 1);
    AddView("away", 0, -1);
    TriangleMesh mesh;
    AddWall(1, {200, 40, 20}, mesh);
    MW_CHECK(WritePly(mesh, PlyPath()).ok());
    report_ = {{"program", "meshwright 1"},
               {"mesh", {{"vertices", 1681}, {"faces", 3200}}},
               {"options", {{"lattice-step", 2}}},
               {"totals", {{"share_covered_before", 0.25}, {"share_grown", 0.5}, {"share_accepted", 0.375}}},
               {"cameras", Json::array()}};
    report_["cameras"].push_back({{"name", "far"},
                                  {"neighbours", 2},
                                  {"seconds", {{"growing", 3.5}}},
                                  {"shares", {{"covered_before", 0.1}, {"grown", 0.5}, {"accepted", 0.5}}}});
    report_["cameras"].push_back({{"name", "away"}, {"skipped", "it cannot be <read>"}});
  }
  ~ReportPageTest() override { fs::remove_all(folder_); }

  void AddView(const std::string& name, double back, double axis) {
    SceneView view;
    view.name = name;
    view.image_path = (folder_ / absl::StrCat(scene_.views.size(), ".png")).string();
    view.lens = {.width = 64, .height = 64, .fx = 32, .fy = 32, .cx = 32, .cy = 32};
    view.cam_from_world.rotation = Eigen::Vector3d(axis, 1, axis).asDiagonal();
    view.cam_from_world.translation = {0, 0, back};
    MW_CHECK(WritePng(view.image_path, {64, 64, std::vector<uint8_t>(3 * 64 * 64, 90)}).ok());
    scene_.views.push_back(view);
  }
  std::string PlyPath() const { return (folder_ / "mesh.ply").string(); }

  std::string Page() {
    ThreadPool pool(2);
    const absl::StatusOr<std::string> page =
        MakeReportPage({.title = "a & b", .report = report_, .scene = scene_, .ply_path = PlyPath()}, pool);
    EXPECT_TRUE(page.ok()) << page.status();
    return page.value_or("");
  }

  fs::path folder_;
  Scene scene_;
  Json report_;
};

TEST_F(ReportPageTest, ItNeedsNothingBesideItself) {
  const std::string page = Page();
  for (const char* const reference : {"http:", "https:", "src=\"/", "href=", "url(", "<script", "@import"}) {
    EXPECT_THAT(page, Not(HasSubstr(reference))) << reference;
  }
  EXPECT_THAT(page, HasSubstr("src=\"data:image/jpeg;base64,"));
}

TEST_F(ReportPageTest, WhatItSaysIsTextWhateverItHolds) {
  const std::string page = Page();
  EXPECT_THAT(page, HasSubstr("a &amp; b"));
  EXPECT_THAT(page, HasSubstr("near &lt;b&gt;"));
  EXPECT_THAT(page, HasSubstr("it cannot be &lt;read&gt;"));
  EXPECT_THAT(page, Not(HasSubstr("<b>")));
  EXPECT_THAT(page, Not(HasSubstr("<read>")));
}

TEST_F(ReportPageTest, EachPhotographIsThereWithWhatItSeesTheLeastFirst) {
  const std::string page = Page();
  const size_t away = page.find("title=\"away\"");
  const size_t far = page.find("title=\"far\"");
  const size_t near = page.find("title=\"near &lt;b&gt;\"");
  ASSERT_NE(near, std::string::npos);
  EXPECT_LT(away, far);
  EXPECT_LT(far, near);
  EXPECT_THAT(page.substr(away, far - away), HasSubstr("mesh in 0 % of it"));
  EXPECT_THAT(page.substr(near), HasSubstr("mesh in 100 % of it"));
  EXPECT_THAT(page.substr(near), HasSubstr("not processed: no pair"));
}

TEST_F(ReportPageTest, APhotographThatIsGoneLeavesALine) {
  fs::remove(scene_.views[1].image_path);
  EXPECT_THAT(Page(), HasSubstr(scene_.views[1].image_path));
}

// Reports are of workers and of earlier programs.
TEST_F(ReportPageTest, AReportThatSaysNothingOrNonsenseIsAPageToo) {
  for (const char* const text :
       {"{}", "[]", "7", R"({"cameras": 5, "totals": [], "mesh": "x", "options": null})",
        R"({"cameras": [7, {"name": 5, "shares": "x", "seconds": {"growing": "long"}}], "losses": {"found": {}}})",
        R"({"totals": {"share_grown": 1e300, "share_accepted": -1, "rays": "many"}})"}) {
    report_ = Json::parse(text);
    EXPECT_THAT(Page(), HasSubstr("</html>")) << text;
  }
}

TEST_F(ReportPageTest, LossesAreToldWhereTheyAreKnown) {
  EXPECT_THAT(Page(), Not(HasSubstr("true surface")));
  report_["losses"] = {{"ground_truth_pixels", 200}, {"found", 150}, {"lost", {{"not_reached", 50}}}};
  EXPECT_THAT(Page(), HasSubstr("<td>not reached</td><td>50</td><td>25.00 %</td>"));
}

TEST(RaySharesTest, TheyAddUp) {
  for (double covered = 0; covered <= 1; covered += 0.125) {
    for (double grown = 0; grown <= 1; grown += 0.125) {
      for (const double accepted : {0.0, grown / 2, grown, 2.0}) {
        const RayShares shares = SharesOf(covered, grown, accepted);
        EXPECT_NEAR(shares.covered + shares.accepted + shares.unconfirmed + shares.empty, 1, 1e-12);
        for (const double share : {shares.covered, shares.accepted, shares.unconfirmed, shares.empty}) {
          EXPECT_GE(share, 0);
        }
      }
    }
  }
}

TEST(DrawMeshTest, WhatIsNearestIsSeenWhateverComesFirst) {
  const Camera camera = {.width = 32, .height = 32, .fx = 16, .fy = 16, .cx = 16, .cy = 16};
  for (const bool near_first : {true, false}) {
    TriangleMesh mesh;
    if (near_first) AddWall(1, {200, 40, 20}, mesh);
    AddWall(2, {20, 40, 200}, mesh);
    if (!near_first) AddWall(1, {200, 40, 20}, mesh);
    const ColorImage image = DrawMesh(MeshRows(mesh), camera, 128);
    EXPECT_EQ(image.At(16, 16), (std::array<uint8_t, 3>{200, 40, 20}));
  }
  TriangleMesh behind;
  AddWall(-1, {200, 40, 20}, behind);
  EXPECT_EQ(DrawMesh(MeshRows(behind), camera, 128).At(16, 16), (std::array<uint8_t, 3>{128, 128, 128}));
}

}  // namespace
}  // namespace meshwright
