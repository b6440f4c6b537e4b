// SPDX-License-Identifier: Apache-2.0
#include "common/geometry/lens.h"

#include <cmath>
#include <string>

#include <gtest/gtest.h>

namespace meshwright {
namespace {

struct LensCase {
  std::string name;
  Lens lens;
};

Lens MakeLens(Lens::Model model, std::array<double, 12> coefficients, double focal = 1000) {
  return {.width = 1600,
          .height = 1200,
          .fx = focal,
          .fy = 1.01 * focal,
          .cx = 810,
          .cy = 590,
          .skew = 1.5,
          .model = model,
          .coefficients = coefficients};
}

class LensModels : public testing::TestWithParam<LensCase> {};

TEST_P(LensModels, PixelFromPlaneUndoesPlaneFromPixelOverTheWholeImage) {
  const Lens& lens = GetParam().lens;
  for (double y = 0; y <= lens.height; y += 25) {
    for (double x = 0; x <= lens.width; x += 25) {
      const Eigen::Vector2d pixel(x, y);
      EXPECT_LT((lens.PixelFromPlane(lens.PlaneFromPixel(pixel)) - pixel).norm(), 1e-7) << x << " " << y;
    }
  }
}

TEST_P(LensModels, PlaneFromPixelUndoesPixelFromPlane) {
  const Lens& lens = GetParam().lens;
  for (double y = -0.5; y <= 0.5; y += 0.05) {
    for (double x = -0.7; x <= 0.7; x += 0.05) {
      const Eigen::Vector2d point(x, y);
      EXPECT_LT((lens.PlaneFromPixel(lens.PixelFromPlane(point)) - point).norm(), 1e-9) << x << " " << y;
    }
  }
}

TEST_P(LensModels, DistortionIsSmoothAtTheAxis) {
  const Lens& lens = GetParam().lens;
  EXPECT_EQ(lens.PixelFromPlane({0, 0}), Eigen::Vector2d(lens.cx, lens.cy));
  EXPECT_EQ(lens.PlaneFromPixel({lens.cx, lens.cy}), Eigen::Vector2d(0, 0));
  EXPECT_LT((lens.Distort({1e-11, 0}) - lens.Distort({1e-13, 0})).norm(), 2e-11);
}

INSTANTIATE_TEST_SUITE_P(
    AllModels, LensModels,
    testing::Values(LensCase{"Pinhole", MakeLens(Lens::Model::kPinhole, {})},
                    LensCase{"Barrel", MakeLens(Lens::Model::kRadial, {-0.15, 0.02})},
                    LensCase{"Pincushion", MakeLens(Lens::Model::kRadial, {0.12, 0.03})},
                    LensCase{"OpenCv", MakeLens(Lens::Model::kOpenCv, {-0.2, 0.05, 1e-3, -2e-3})},
                    LensCase{"FullOpenCv",
                             MakeLens(Lens::Model::kFullOpenCv, {-0.3, 0.1, 1e-3, 5e-4, 0.02, -0.1, 0.05, 0.01})},
                    LensCase{"OpenCvFisheye", MakeLens(Lens::Model::kOpenCvFisheye, {0.05, -0.01, 0.004, -0.001})},
                    LensCase{"RadialFisheye", MakeLens(Lens::Model::kRadialFisheye, {-0.03, 0.004})},
                    LensCase{"Fov", MakeLens(Lens::Model::kFov, {0.9})},
                    LensCase{"FovWithoutDistortion", MakeLens(Lens::Model::kFov, {0})},
                    LensCase{"Brown", MakeLens(Lens::Model::kBrown, {-0.2, 0.05, 1e-3, -2e-3, 0.01, -0.002})},
                    LensCase{"RadTanThinPrismFisheye",
                             MakeLens(Lens::Model::kRadTanThinPrismFisheye,
                                      {-0.02, 0.01, -0.004, 0.001, 1e-4, 1e-5, 1e-3, -1e-3, 5e-4, -2e-4, 3e-4, 1e-4})},
                    LensCase{"Division", MakeLens(Lens::Model::kDivision, {-0.2})},
                    LensCase{"DivisionInwards", MakeLens(Lens::Model::kDivision, {0.1})},
                    LensCase{"Eucm", MakeLens(Lens::Model::kEucm, {0.6, 1.1})},
                    LensCase{"ThinPrismFisheye", MakeLens(Lens::Model::kThinPrismFisheye,
                                                          {-0.03, 0.01, 1e-3, -1e-3, 0.002, -0.001, 5e-4, -5e-4})}),
    [](const testing::TestParamInfo<LensCase>& info) { return info.param.name; });

// Values worked out by hand from the models' formulas.
TEST(Lens, FollowsThePublishedFormulas) {
  // r^2 = 0.05: 1 + 0.05 * 0.1 + 0.0025 * 0.2 = 1.0055.
  const Lens radial = MakeLens(Lens::Model::kRadial, {0.1, 0.2});
  EXPECT_LT((radial.Distort({0.2, 0.1}) - Eigen::Vector2d(0.2011, 0.10055)).norm(), 1e-12);
  // p1 = 0.01, p2 = 0.02: 2 p1 xy + p2 (r^2 + 2 x^2) = 0.0004 + 0.0026; p1 (r^2 + 2 y^2) + 2 p2 xy = 0.0007 + 0.0008.
  const Lens open_cv = MakeLens(Lens::Model::kOpenCv, {0.1, 0.2, 0.01, 0.02});
  EXPECT_LT((open_cv.Distort({0.2, 0.1}) - Eigen::Vector2d(0.2041, 0.10205)).norm(), 1e-12);
  // A fisheye without coefficients is equidistant: tan(angle) = 1 is imaged at pi / 4.
  const Lens fisheye = MakeLens(Lens::Model::kOpenCvFisheye, {});
  EXPECT_LT((fisheye.Distort({1, 0}) - Eigen::Vector2d(M_PI / 4, 0)).norm(), 1e-12);
  // FOV: the point at tan(omega / 2) is imaged at r = atan(2 tan(omega / 2)^2) / omega.
  const Lens fov = MakeLens(Lens::Model::kFov, {0.8});
  const double t = std::tan(0.4);
  EXPECT_NEAR(fov.Distort({0, t}).y(), std::atan(2 * t * t) / 0.8, 1e-12);
}

TEST(Lens, InverseStaysFiniteWhereTheModelHasNone) {
  // The polynomial turns back at r = 0.58 and never reaches the corners.
  const Lens folding = MakeLens(Lens::Model::kRadial, {-1, 0});
  EXPECT_TRUE(folding.PlaneFromPixel({0, 0}).allFinite());
  // More than 90 degrees from the axis.
  const Lens wide = MakeLens(Lens::Model::kOpenCvFisheye, {}, 300);
  EXPECT_TRUE(wide.PlaneFromPixel({0, 0}).allFinite());
  EXPECT_GT(wide.PlaneFromPixel({0, 0}).norm(), 1e5);
}

}  // namespace
}  // namespace meshwright
