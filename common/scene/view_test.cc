// SPDX-License-Identifier: Apache-2.0
#include "common/scene/view.h"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/base/files.h"
#include "common/image/encode.h"
#include "common/scene/formats/assemble.h"
#include "common/scene/formats/small_scenes.h"

namespace meshwright {
namespace {

using testing::AllOf;
using testing::HasSubstr;

struct LensCase {
  std::string name;
  Lens lens;
};

Lens MakeLens(Lens::Model model, std::array<double, 12> coefficients, double focal = 300) {
  return {.width = 320,
          .height = 240,
          .fx = focal,
          .fy = 1.02 * focal,
          .cx = 164.3,
          .cy = 115.8,
          .model = model,
          .coefficients = coefficients};
}

Lens WithSkew(Lens lens) {
  lens.skew = 12;
  return lens;
}

// What is seen in the direction of a point of the plane z = 1: smooth at the size of a few pixels.
double Pattern(const Eigen::Vector2d& point, size_t channel) {
  const double phase = static_cast<double>(channel);
  return 128 + 60 * std::sin(25 * point.x() + phase) * std::cos(21 * point.y() - phase) + 40 * std::sin(13 * point.y());
}

template <typename PlaneFromPixel>
ColorImage Render(int width, int height, const PlaneFromPixel& plane_from_pixel) {
  ColorImage image{.width = width, .height = height, .rgb = {}};
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const Eigen::Vector2d point = plane_from_pixel(Eigen::Vector2d(x + 0.5, y + 0.5));
      for (size_t c = 0; c < 3; ++c) image.rgb.push_back(static_cast<uint8_t>(std::lround(Pattern(point, c))));
    }
  }
  return image;
}

int LargestDifference(const ColorImage& a, const ColorImage& b) {
  int largest = 0;
  for (size_t i = 0; i < a.rgb.size(); ++i) largest = std::max(largest, std::abs(a.rgb[i] - b.rgb[i]));
  return largest;
}

SceneView WriteView(const Lens& lens, const std::string& name) {
  SceneView view{.name = name, .image_path = JoinPath(FreshFolder("view"), name + ".png"), .lens = lens};
  const ColorImage image =
      Render(lens.width, lens.height, [&](const Eigen::Vector2d& pixel) { return lens.PlaneFromPixel(pixel); });
  EXPECT_TRUE(WritePng(view.image_path, image).ok());
  return view;
}

class Undistortion : public testing::TestWithParam<LensCase> {};

TEST_P(Undistortion, GivesThePictureOfAPinhole) {
  const SceneView view = WriteView(GetParam().lens, GetParam().name);
  const absl::StatusOr<View> loaded = LoadView(view, 0);
  ASSERT_TRUE(loaded.ok()) << loaded.status();
  const Camera& camera = loaded->camera;
  ASSERT_EQ(loaded->color.width, camera.width);
  ASSERT_EQ(loaded->color.height, camera.height);
  const ColorImage expected = Render(camera.width, camera.height, [&](const Eigen::Vector2d& pixel) -> Eigen::Vector2d {
    return camera.RayInCam(pixel.x(), pixel.y()).head<2>();
  });
  EXPECT_LE(LargestDifference(loaded->color, expected), 3);
}

TEST_P(Undistortion, EveryPixelHasASourceAndTheRectangleIsLarge) {
  const Lens& lens = GetParam().lens;
  const Camera camera = UndistortedCamera({.lens = lens}, 0);
  EXPECT_EQ(camera.fx, lens.fx);
  EXPECT_EQ(camera.fy, lens.fy);
  const auto is_seen = [&](double x, double y, double margin) {
    const Eigen::Vector2d pixel = lens.PixelFromPlane(camera.RayInCam(x, y).head<2>());
    return pixel.x() >= -margin && pixel.y() >= -margin && pixel.x() <= lens.width + margin &&
           pixel.y() <= lens.height + margin;
  };
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) ASSERT_TRUE(is_seen(x + 0.5, y + 0.5, 0)) << x << " " << y;
  }
  // Two pixels more on any side would leave the picture somewhere.
  int held_sides = 0;
  for (const auto& [x0, y0, x1, y1] :
       {std::array<double, 4>{-2, 0, -2, 1}, {1, 0, 1, 1}, {0, -2, 1, -2}, {0, 1, 1, 1}}) {
    bool leaves = false;
    for (double t = 0; t <= 1; t += 0.01) {
      const double u = x0 == x1 ? x0 : t;
      const double v = y0 == y1 ? y0 : t;
      const double x = u < 0 ? u : u * camera.width + (x0 == x1 && u == 1 ? 2 : 0);
      const double y = v < 0 ? v : v * camera.height + (y0 == y1 && v == 1 ? 2 : 0);
      leaves = leaves || !is_seen(x, y, 0);
    }
    held_sides += leaves ? 1 : 0;
  }
  EXPECT_EQ(held_sides, 4);
}

TEST_P(Undistortion, ScalesImageAndCameraAlike) {
  const SceneView view = WriteView(GetParam().lens, GetParam().name + "_scaled");
  const Camera full = UndistortedCamera(view, 0);
  const absl::StatusOr<View> loaded = LoadView(view, 131);
  ASSERT_TRUE(loaded.ok()) << loaded.status();
  const Camera& camera = loaded->camera;
  EXPECT_EQ(std::max(camera.width, camera.height), 131);
  EXPECT_NEAR(camera.fx / full.fx, static_cast<double>(camera.width) / full.width, 1e-12);
  EXPECT_NEAR(camera.cy / full.cy, static_cast<double>(camera.height) / full.height, 1e-12);
  // The same corner of the picture is seen in the same direction.
  EXPECT_LT((camera.RayInCam(camera.width, camera.height) - full.RayInCam(full.width, full.height)).norm(), 1e-12);
  const ColorImage expected = Render(camera.width, camera.height, [&](const Eigen::Vector2d& pixel) -> Eigen::Vector2d {
    return camera.RayInCam(pixel.x(), pixel.y()).head<2>();
  });
  EXPECT_LE(LargestDifference(loaded->color, expected), 6);  // a mean over a pixel's area is not its centre's value
}

INSTANTIATE_TEST_SUITE_P(Lenses, Undistortion,
                         testing::Values(LensCase{"Pinhole", MakeLens(Lens::Model::kPinhole, {})},
                                         LensCase{"Skew", WithSkew(MakeLens(Lens::Model::kPinhole, {}))},
                                         LensCase{"Barrel", MakeLens(Lens::Model::kRadial, {-0.2, 0.03})},
                                         LensCase{"Pincushion", MakeLens(Lens::Model::kRadial, {0.2, 0})},
                                         LensCase{"OpenCv", MakeLens(Lens::Model::kOpenCv, {-0.2, 0.05, 3e-3, -4e-3})},
                                         LensCase{"Fov", MakeLens(Lens::Model::kFov, {0.8})},
                                         LensCase{"Fisheye",
                                                  MakeLens(Lens::Model::kOpenCvFisheye, {0.02, -0.01, 0, 0})}),
                         [](const testing::TestParamInfo<LensCase>& info) { return info.param.name; });

TEST(UndistortedCamera, NoDistortionMeansNoResampling) {
  const SceneView plain = WriteView(MakeLens(Lens::Model::kPinhole, {}), "plain");
  SceneView radial = plain;
  radial.lens.model = Lens::Model::kRadial;  // with coefficients of 0
  const View a = LoadView(plain, 0).value();
  const View b = LoadView(radial, 0).value();
  EXPECT_EQ(a.camera.width, b.camera.width);
  EXPECT_EQ(a.camera.height, b.camera.height);
  EXPECT_NEAR(a.camera.cx, b.camera.cx, 1e-12);
  EXPECT_EQ(a.color.rgb, b.color.rgb);
}

TEST(UndistortedCamera, VeryWideLensesAreCutOff) {
  // An equidistant fisheye of 200 degrees.
  const Lens lens{
      .width = 1000, .height = 1000, .fx = 286, .fy = 286, .cx = 500, .cy = 500, .model = Lens::Model::kOpenCvFisheye};
  const Camera camera = UndistortedCamera({.lens = lens}, 0);
  EXPECT_NEAR(camera.width, 4 * 286, 1);
  EXPECT_NEAR(camera.height, 4 * 286, 1);
}

TEST(UndistortedCamera, LensesThatFoldAreCutWhereTheyDo) {
  // r (1 - r^2) turns back at r = 0.577, before the corners, which lie at r = 0.67, are reached.
  const Lens lens = MakeLens(Lens::Model::kRadial, {-1, 0});
  const Camera camera = UndistortedCamera({.lens = lens}, 0);
  ASSERT_GT(camera.width, 50);
  for (const double x : {0, camera.width}) {
    for (const double y : {0, camera.height}) EXPECT_LT(camera.RayInCam(x, y).head<2>().norm(), 0.578);
  }
}

TEST(UndistortedCamera, PicturesAreNeverEnlarged) {
  const SceneView view{.lens = MakeLens(Lens::Model::kPinhole, {})};
  EXPECT_EQ(UndistortedCamera(view, 10000).width, 320);
  EXPECT_EQ(UndistortedCamera(view, 320).width, 320);
  EXPECT_EQ(UndistortedCamera(view, 160).width, 160);
  EXPECT_EQ(UndistortedCamera(view, 160).height, 120);
  EXPECT_EQ(UndistortedCamera(view, 1).height, 1);
}

TEST(LoadView, NamesFileAndSizes) {
  SceneView view = WriteView(MakeLens(Lens::Model::kPinhole, {}), "errors");
  std::string bytes = ReadFile(view.image_path).value();
  view.lens.width = 640;
  absl::Status status = LoadView(view, 0).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(status.message()),
              AllOf(HasSubstr(view.image_path), HasSubstr("320 x 240"), HasSubstr("640 x 240")));

  ASSERT_TRUE(WriteFileAtomically(view.image_path, bytes.substr(0, bytes.size() / 2)).ok());
  status = LoadView(view, 0).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(status.message()), AllOf(HasSubstr(view.image_path), HasSubstr("truncated")));

  view.image_path += ".none";
  EXPECT_EQ(LoadView(view, 0).status().code(), absl::StatusCode::kNotFound);
}

// A mask whose left `columns` are black.
std::string LeftBlack(int width, int height, int columns) {
  ColorImage mask{.width = width, .height = height, .rgb = {}};
  for (int i = 0; i < width * height; ++i) mask.rgb.insert(mask.rgb.end(), 3, i % width < columns ? 0 : 255);
  return EncodePng(mask);
}

TEST(LoadView, AMaskGoesTheWayOfItsPicture) {
  for (const Lens& lens : {MakeLens(Lens::Model::kPinhole, {}), MakeLens(Lens::Model::kRadial, {-0.15, 0.02})}) {
    SceneView view = WriteView(lens, "masked");
    view.mask_path = view.image_path + ".png";
    for (const int factor : {1, 2}) {
      const int black = 100;
      ASSERT_TRUE(
          WriteFileAtomically(view.mask_path, LeftBlack(lens.width / factor, lens.height / factor, black / factor))
              .ok());
      for (const int max_image_size : {0, 140}) {
        const absl::StatusOr<View> loaded = LoadView(view, max_image_size);
        ASSERT_TRUE(loaded.ok()) << loaded.status();
        const Camera& camera = loaded->camera;
        // Whatever has anything of the black side is ignored, and not much more than that.
        const double reach = 2.5 * std::max(1.0, lens.fx / camera.fx) * factor;
        for (int y = 0; y < camera.height; y += 3) {
          for (int x = 0; x < camera.width; ++x) {
            const double in_picture = lens.PixelFromPlane(camera.RayInCam(x + 0.5, y + 0.5).head<2>()).x();
            if (in_picture < black) EXPECT_TRUE(loaded->ignored.At(x, y)) << x << " " << y;
            if (in_picture > black + reach) EXPECT_FALSE(loaded->ignored.At(x, y)) << x << " " << y;
          }
        }
      }
    }
  }
}

TEST(LoadView, AMaskOfAnotherShapeIsRefused) {
  const Lens lens = MakeLens(Lens::Model::kPinhole, {});
  SceneView view = WriteView(lens, "misfit");
  view.mask_path = view.image_path + ".png";
  ASSERT_TRUE(WriteFileAtomically(view.mask_path, LeftBlack(lens.height, lens.width, 3)).ok());
  EXPECT_THAT(std::string(LoadView(view, 0).status().message()),
              AllOf(HasSubstr("misfit.png.png: the mask has 240 x 320 px"), HasSubstr("320 x 240")));
  ASSERT_TRUE(WriteFileAtomically(view.mask_path, "no picture").ok());
  EXPECT_EQ(LoadView(view, 0).status().code(), absl::StatusCode::kInvalidArgument);
}

}  // namespace
}  // namespace meshwright
