// SPDX-License-Identifier: Apache-2.0
#include "pipeline/report/verdict.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace meshwright {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;
using Json = nlohmann::ordered_json;

Json CameraEntry(int camera, int rays, int covered_before, int grown, int filtered) {
  return {{"camera", camera},    {"name", "photograph " + std::to_string(camera)},
          {"rays", rays},        {"rays_covered_before", covered_before},
          {"rays_grown", grown}, {"rays_filtered", filtered}};
}

double SumOf(const Json& fate) {
  double sum = 0;
  for (const char* key : {"coverage", "blind", "inconsistent", "unsupported", "contradicted"}) {
    EXPECT_GE(fate[key].get<double>(), 0) << key;
    sum += fate[key].get<double>();
  }
  return sum;
}

TEST(Verdict, EveryRayHasOneFate) {
  // The second camera's kept patches and those that were there before share rays; the third one was not judged.
  Json cameras = {CameraEntry(0, 1000, 0, 600, 500), CameraEntry(1, 1000, 800, 500, 450),
                  CameraEntry(2, 1000, 300, 200, 0)};
  const Json verdict = MakeVerdict(
      {{.camera = 0, .kept = 350, .inferred = 30, .contradicted = 50, .unsupported = 100}, {.camera = 1, .kept = 400}},
      cameras);
  for (const Json& camera : cameras) EXPECT_NEAR(SumOf(camera["fate"]), 1, 1e-12);
  EXPECT_NEAR(SumOf(verdict), 1, 1e-12);
  EXPECT_DOUBLE_EQ(cameras[0]["fate"]["coverage"], 0.35);
  EXPECT_DOUBLE_EQ(cameras[0]["fate"]["unsupported"], 0.1);
  EXPECT_DOUBLE_EQ(cameras[0]["fate"]["contradicted"], 0.05);
  EXPECT_DOUBLE_EQ(cameras[0]["fate"]["inconsistent"], 0.1);
  EXPECT_DOUBLE_EQ(cameras[0]["fate"]["blind"], 0.4);
  EXPECT_DOUBLE_EQ(cameras[1]["fate"]["coverage"], 1);
  EXPECT_DOUBLE_EQ(cameras[2]["fate"]["inconsistent"], 0.2);
  EXPECT_DOUBLE_EQ(verdict["coverage"], (350 + 1000 + 300) / 3000.0);
  EXPECT_DOUBLE_EQ(cameras[0]["fate"]["inferred"], 0.03);
  EXPECT_DOUBLE_EQ(verdict["inferred"], 0.01);
  EXPECT_EQ(verdict["least_covered"]["name"], "photograph 2");
}

TEST(Verdict, SkippedCamerasAreLeftOut) {
  Json cameras = {CameraEntry(0, 1000, 0, 600, 500), {{"camera", 1}, {"name", "b"}, {"skipped", "broken"}}};
  const Json verdict = MakeVerdict({{.camera = 0, .kept = 500}}, cameras);
  EXPECT_DOUBLE_EQ(verdict["coverage"], 0.5);
  EXPECT_FALSE(cameras[1].contains("fate"));
}

TEST(Verdict, SaysHowFarCamerasAreOffWhereItIsKnown) {
  Json cameras = Json::array();
  for (int i = 0; i < 5; ++i) {
    cameras.push_back(CameraEntry(i, 1000, 0, 600, 500));
    // The last one is far off, and does not speak for the others.
    cameras.back()["epipolar_squares"] = 1000 * (i < 4 ? 2.25 : 81);
    cameras.back()["epipolar_measurements"] = 1000;
  }
  Json verdict = MakeVerdict({}, cameras);
  EXPECT_DOUBLE_EQ(verdict["cameras_off_px"], 1.5);
  EXPECT_THAT(DescribeWarning(verdict), HasSubstr("1.5 px off"));
  EXPECT_DOUBLE_EQ(cameras[4]["off_px"], 9);
  // Noise may leave less than nothing; and next to no measurements say nothing.
  for (Json& camera : cameras) camera["epipolar_squares"] = -3;
  verdict = MakeVerdict({}, cameras);
  EXPECT_EQ(verdict["cameras_off_px"], 0);
  EXPECT_EQ(DescribeWarning(verdict), "");
  for (Json& camera : cameras) camera["epipolar_measurements"] = 3;
  verdict = MakeVerdict({}, cameras);
  EXPECT_TRUE(verdict["cameras_off_px"].is_null());
  EXPECT_EQ(DescribeWarning(verdict), "");
}

TEST(Verdict, NothingProcessedIsNoDivisionByZero) {
  Json cameras = Json::array();
  const Json verdict = MakeVerdict({}, cameras);
  EXPECT_EQ(verdict["coverage"], 0);
  EXPECT_THAT(DescribeVerdict(verdict), Not(HasSubstr("nan")));
}

}  // namespace
}  // namespace meshwright
