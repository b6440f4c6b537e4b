// SPDX-License-Identifier: Apache-2.0
// Every format that other programs write, from a scene written in it: poses, lenses and points come back.
#include "tests/scene_formats/scene_writers.h"

#include <algorithm>
#include <cstdlib>
#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/scene/formats/export_colmap.h"
#include "common/scene/formats/formats.h"
#include "common/scene/formats/import.h"

namespace meshwright {
namespace {

using testing::AllOf;
using testing::HasSubstr;

ImportOptions OptionsFor(const SceneWriter& writer) {
  if (writer.has_intrinsics) return {};
  const Lens lens = SmallSceneWithin(writer.limits).views[0].lens;
  return {.intrinsics = {{lens.fx, lens.fy, lens.cx, lens.cy}}};
}

std::string WriteFresh(const SceneFiles& files) {
  std::string folder = FreshFolder("written");
  WriteScene(folder, files);
  return folder;
}

void ExpectSameViews(const Scene& read, const Scene& written, double tolerance, const SceneWriter& writer = {}) {
  ASSERT_EQ(read.views.size(), written.views.size());
  for (size_t i = 0; i < read.views.size(); ++i) {
    const SceneView& a = read.views[i];
    const SceneView& b = written.views[i];
    EXPECT_THAT(a.image_path, testing::EndsWith("/" + PicturePath(writer, b.name)));
    EXPECT_LT((a.cam_from_world.rotation - b.cam_from_world.rotation).norm(), tolerance);
    EXPECT_LT((a.cam_from_world.translation - b.cam_from_world.translation).norm(), tolerance);
    EXPECT_EQ(a.lens.width, b.lens.width);
    EXPECT_EQ(a.lens.height, b.lens.height);
    for (double y = -0.2; y <= 0.2; y += 0.1) {
      for (double x = -0.2; x <= 0.2; x += 0.1) {
        EXPECT_LT((a.lens.PixelFromPlane({x, y}) - b.lens.PixelFromPlane({x, y})).norm(), 20 * tolerance);
      }
    }
  }
}

class SceneWriterTest : public testing::TestWithParam<size_t> {
 protected:
  const SceneWriter& writer() const { return SceneWriters()[GetParam()]; }
};

TEST_P(SceneWriterTest, WhatIsWrittenIsRead) {
  SCOPED_TRACE(std::string(writer().format) + " " + writer().variant);
  const Scene written = SmallSceneWithin(writer().limits);
  const absl::StatusOr<Scene> read = ImportScene(WriteFresh(SmallSceneAs(writer())), OptionsFor(writer()));
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_EQ(read->format, writer().format);
  ExpectSameViews(*read, written, 1e-9, writer());
  if (!writer().has_points) {
    EXPECT_TRUE(read->points.empty());
    return;
  }
  ASSERT_EQ(read->points.size(), written.points.size());
  for (const SparsePoint& point : written.points) {
    EXPECT_TRUE(std::any_of(read->points.begin(), read->points.end(), [&](const SparsePoint& p) {
      return p.seen_by == point.seen_by && (p.x_in_world - point.x_in_world).norm() < writer().point_digits;
    }));
  }
}

TEST_P(SceneWriterTest, EveryRefusalIsOneLineThatNamesTheFile) {
  if (writer().has_intrinsics) return;
  const absl::Status status = ImportScene(WriteFresh(SmallSceneAs(writer()))).status();
  EXPECT_THAT(std::string(status.message()), HasSubstr("--intrinsics FX,FY,CX,CY"));
}

INSTANTIATE_TEST_SUITE_P(All, SceneWriterTest, testing::Range(size_t{0}, SceneWriters().size()));

TEST(SceneFormatsTest, EveryOneHasATest) {
  for (const SceneFormat& format : SceneFormats()) {
    const std::string name = format.name;
    const bool here = std::any_of(SceneWriters().begin(), SceneWriters().end(),
                                  [&](const SceneWriter& writer) { return name == writer.format; });
    // The others are compared with COLMAP's text, which ExportColmapText writes.
    EXPECT_TRUE(here || name == "colmap-text") << name;
  }
}

// What COLMAP itself makes of a scene, in the formats of others that it writes.
class ColmapConverterTest : public testing::TestWithParam<const char*> {};

TEST_P(ColmapConverterTest, IsReadAsTheSceneItWas) {
  if (std::system("command -v colmap >/dev/null") != 0) GTEST_SKIP() << "colmap is not installed";
  const std::string type = GetParam();
  const Scene written = SmallSceneWithin({.two_focals = false, .free_center = false, .radial = type == "NVM" ? 0 : 2});
  const std::string folder = WriteFresh(
      {{"images/a.png", SmallPicture()}, {"images/b.png", SmallPicture()}, {"images/c.png", SmallPicture()}});
  const std::string model = FreshFolder("colmap_model");
  Scene simple = written;
  ASSERT_TRUE(ExportColmapText(simple, model).ok());
  const std::string output = type == "NVM" ? folder + "/model.nvm" : folder + "/model";
  // NVM has one coefficient: COLMAP writes it for SIMPLE_RADIAL and simpler models alone.
  if (type == "NVM") {
    const std::string sed =
        "sed -i 's/ PINHOLE 12 10 20 20 6 5/ SIMPLE_PINHOLE 12 10 20 6 5/' " + model + "/cameras.txt";
    ASSERT_EQ(std::system(sed.c_str()), 0);
  }
  const std::string command = "colmap model_converter --input_path " + model + " --output_path " + output +
                              " --output_type " + type + " >/dev/null 2>&1";
  ASSERT_EQ(std::system(command.c_str()), 0);
  const absl::StatusOr<Scene> read = ImportScene(folder);
  ASSERT_TRUE(read.ok()) << read.status();
  ExpectSameViews(*read, written, 1e-5);  // it writes few digits
  EXPECT_EQ(read->points.size(), written.points.size());
}

INSTANTIATE_TEST_SUITE_P(Types, ColmapConverterTest, testing::Values("NVM", "Bundler"));

std::string Refusal(const SceneFiles& files, const ImportOptions& options = {}) {
  const absl::Status status = ImportScene(WriteFresh(files), options).status();
  EXPECT_FALSE(status.ok());
  EXPECT_EQ(status.message().find('\n'), absl::string_view::npos);
  return std::string(status.message());
}

SceneFiles Changed(const char* format, const std::string& file, const std::string& from, const std::string& to) {
  for (const SceneWriter& writer : SceneWriters()) {
    if (writer.format != std::string(format)) continue;
    SceneFiles files = SmallSceneAs(writer);
    const size_t at = files[file].find(from);
    EXPECT_NE(at, std::string::npos) << format << " " << from;
    if (at != std::string::npos) files[file].replace(at, from.size(), to);
    return files;
  }
  ADD_FAILURE() << format;
  return {};
}

TEST(SceneErrorsTest, NameFileFieldValueAndWhatWasExpected) {
  EXPECT_THAT(
      Refusal(Changed("opensfm", "reconstruction.json", "\"brown\"", "\"spherical\"")),
      AllOf(HasSubstr("reconstruction.json"), HasSubstr("projection_type is \"spherical\"; expected perspective")));
  EXPECT_THAT(Refusal(Changed("opensfm", "reconstruction.json", "\"shots\"", "\"shotz\"")),
              HasSubstr("[0].shots is missing"));
  EXPECT_THAT(Refusal(Changed("opensfm", "tracks.csv", "a.png\t0\t7\t0.1\t0.2\t1\t1\t2\t3", "a.png\t0")),
              HasSubstr("tracks.csv, line 2"));
  EXPECT_THAT(Refusal(Changed("alicevision", "cameras.sfm", "\"brown\"", "\"3deanamorphic4\"")),
              HasSubstr("distortion is \"3deanamorphic4\" with 5 parameters; expected none, radialk1"));
  EXPECT_THAT(Refusal(Changed("alicevision", "cameras.sfm", "\"poses\"", "\"pozes\"")),
              HasSubstr("no camera has a pose (3 views); expected the cameras.sfm of StructureFromMotion"));
  EXPECT_THAT(Refusal(Changed("openmvg", "sfm_data.json", "\"extrinsics\"", "\"extrinsicz\"")),
              HasSubstr("expected the sfm_data of the reconstruction's folder"));
  EXPECT_THAT(Refusal(Changed("openmvg", "sfm_data.json", "pinhole_brown_t2", "spherical")),
              HasSubstr("polymorphic_name is \"spherical\"; expected pinhole"));
  EXPECT_THAT(Refusal(Changed("metashape", "cameras.xml", "type=\"frame\" class=\"adjusted\"",
                              "type=\"spherical\" class=\"adjusted\"")),
              AllOf(HasSubstr("cameras.xml, line 5"), HasSubstr("type of sensor is \"spherical\"")));
  EXPECT_THAT(Refusal(Changed("metashape", "cameras.xml", "0 0 0 1</transform>", "0 0 1</transform>")),
              HasSubstr("ends early; expected transform"));
  EXPECT_THAT(Refusal(Changed("blocks-exchange", "blocks.xml", "XRightYDown", "XRightYUp")),
              HasSubstr("CameraOrientation is \"XRightYUp\"; expected XRightYDown"));
  EXPECT_THAT(Refusal(Changed("transforms-json", "transforms.json", "\"OPENCV\"", "\"EQUIRECTANGULAR\"")),
              HasSubstr("camera_model is \"EQUIRECTANGULAR\"; expected OPENCV"));
  EXPECT_THAT(Refusal(Changed("transforms-json", "transforms.json", "\"frames\"", "\"framez\"")),
              HasSubstr("frames is missing; expected the cameras of a transforms.json"));
  EXPECT_THAT(Refusal(Changed("bundler", "bundle.out", "\n4 4\n", "\n5 4\n")),
              HasSubstr("bundle.out, line 2: number of cameras is 5; expected that of the names in"));
  EXPECT_THAT(Refusal(Changed("nvm", "model.nvm", "NVM_V3", "NVM_V2")),
              HasSubstr("model.nvm, line 1: first word is \"NVM_V2\"; expected NVM_V3"));
  EXPECT_THAT(Refusal(Changed("mvsnet", "cams/a_cam.txt", "20 0 6.25\n0 21 4.625", "20 0 12.5\n0 21 9.25")),
              HasSubstr("principal point"));
  EXPECT_THAT(Refusal(Changed("openmvs", "scene.mvs", "MVSI", std::string("MVS\0", 4))),
              HasSubstr("expected MVSI, which --archive-type -1 writes"));
}

TEST(SceneErrorsTest, LengthsThatLieAllocateNothing) {
  SceneFiles files = Changed("openmvs", "scene.mvs", "MVSI", "MVSI");
  files["scene.mvs"].replace(12, 8, std::string("\xFF\xFF\xFF\xFF\xFF\xFF\xFF\x7F", 8));
  EXPECT_THAT(Refusal(files), HasSubstr("number of platforms is 9223372036854775807; expected at most"));
}

TEST(SceneErrorsTest, JsonThatIsNestedDeepIsRefused) {
  SceneFiles files = Changed("openmvg", "sfm_data.json", "{", "{");
  files["sfm_data.json"] = std::string(100'000, '[');
  EXPECT_THAT(Refusal(files), HasSubstr("100000 levels deep"));
}

TEST(SevenScenesTest, APoseThatIsNotFiniteIsNone) {
  SceneFiles files;
  for (int i = 0; i < 4; ++i) {
    const std::string stem = "frame-00000" + std::to_string(i);
    files[stem + ".color.png"] = SmallPicture();
    files[stem + ".pose.txt"] =
        i == 2 ? "-inf 0 0 0\n0 nan 0 0\n0 0 1 0\n0 0 0 1\n" : "1 0 0 1\n0 0 -1 2\n0 1 0 3\n0 0 0 1\n";
  }
  const absl::StatusOr<Scene> scene = ImportScene(WriteFresh(files), {.intrinsics = {{20, 20, 6, 5}}});
  ASSERT_TRUE(scene.ok()) << scene.status();
  EXPECT_EQ(scene->format, "7-scenes");
  ASSERT_EQ(scene->views.size(), 3U);
  const Rigid3& pose = scene->views[0].cam_from_world;
  EXPECT_LT((pose * Eigen::Vector3d(1, 2, 3)).norm(), 1e-12);                             // its centre
  EXPECT_LT((pose * Eigen::Vector3d(1, 1, 3) - Eigen::Vector3d(0, 0, 1)).norm(), 1e-12);  // in front: -Y
  EXPECT_THAT(scene->warnings, testing::Contains(HasSubstr("1 photographs have no pose")));
}

TEST(RescaleCamerasTest, CamerasFollowPhotographsOfOneFactor) {
  const Scene written = SmallSceneWithin({});
  SceneFiles files = Changed("transforms-json", "transforms.json", "{", "{");
  std::string& text = files["transforms.json"];
  for (size_t at = 0; (at = text.find("\"w\":12", at)) != std::string::npos;) text.replace(at, 6, "\"w\":24");
  for (size_t at = 0; (at = text.find("\"h\":10", at)) != std::string::npos;) text.replace(at, 6, "\"h\":20");
  EXPECT_THAT(Refusal(files), HasSubstr("--rescale-cameras makes cameras follow"));
  const absl::StatusOr<Scene> scene = ImportScene(WriteFresh(files), {.rescale_cameras = true});
  ASSERT_TRUE(scene.ok()) << scene.status();
  EXPECT_EQ(scene->views[0].lens.width, kSmallWidth);
  EXPECT_NEAR(scene->views[0].lens.fx, written.views[0].lens.fx / 2, 1e-12);
  EXPECT_NEAR(scene->views[0].lens.cy, written.views[0].lens.cy / 2, 1e-12);
}

}  // namespace
}  // namespace meshwright
