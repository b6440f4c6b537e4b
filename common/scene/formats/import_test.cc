// SPDX-License-Identifier: Apache-2.0
#include "common/scene/formats/import.h"

#include <filesystem>

#include <Eigen/Geometry>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/scene/formats/assemble.h"
#include "common/scene/formats/export_colmap.h"
#include "common/scene/formats/small_scenes.h"

namespace meshwright {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::EndsWith;
using testing::HasSubstr;
using testing::IsEmpty;

std::string ReplaceOnce(std::string text, const std::string& from, const std::string& to) {
  const size_t position = text.find(from);
  EXPECT_NE(position, std::string::npos) << from;
  return text.replace(position, from.size(), to);
}

// The poses that all four small scenes describe.
void ExpectSmallPoses(const Scene& scene) {
  ASSERT_EQ(scene.views.size(), 3);
  EXPECT_EQ(scene.views[0].name, "a.png");
  EXPECT_EQ(scene.views[1].name, "b.png");
  EXPECT_EQ(scene.views[2].name, "c.png");
  Eigen::Matrix3d a;
  a << 1, 0, 0, 0, 0, -1, 0, 1, 0;  // a quarter turn about x
  const Eigen::Matrix3d c = Eigen::Vector3d(-1, 1, -1).asDiagonal();
  EXPECT_LT((scene.views[0].cam_from_world.rotation - a).norm(), 1e-12);
  EXPECT_LT((scene.views[1].cam_from_world.rotation - Eigen::Matrix3d::Identity()).norm(), 1e-12);
  EXPECT_LT((scene.views[2].cam_from_world.rotation - c).norm(), 1e-12);
  EXPECT_LT((scene.views[0].cam_from_world.translation - Eigen::Vector3d(1, 2, 3)).norm(), 1e-12);
  EXPECT_LT((scene.views[2].cam_from_world.translation - Eigen::Vector3d(-1, 0.5, 2)).norm(), 1e-12);
  for (const SceneView& view : scene.views) {
    EXPECT_EQ(view.lens.width, kSmallWidth);
    EXPECT_EQ(view.lens.height, kSmallHeight);
    EXPECT_TRUE(IsFile(view.image_path)) << view.image_path;
  }
  const Lens& b = scene.views[1].lens;
  EXPECT_EQ(std::tie(b.fx, b.fy, b.cx, b.cy), std::make_tuple(20.0, 21.0, 6.0, 5.0));
}

void ExpectSmallColmapRest(const Scene& scene) {
  const Lens& lens = scene.views[0].lens;
  EXPECT_EQ(lens.model, Lens::Model::kOpenCv);
  EXPECT_THAT(lens.coefficients, ElementsAre(0.01, -0.02, 0.001, 0, 0, 0, 0, 0, 0, 0, 0, 0));
  EXPECT_EQ(lens.cy, 5.25);
  ASSERT_EQ(scene.points.size(), 4);
  EXPECT_THAT(scene.points[0].seen_by, ElementsAre(0, 1));
  EXPECT_THAT(scene.points[1].seen_by, ElementsAre(0, 1, 2));
  EXPECT_THAT(scene.points[2].seen_by, ElementsAre(1, 2));
  EXPECT_EQ(scene.points[2].x_in_world, Eigen::Vector3d(-1, 0, 4));
  EXPECT_EQ(scene.points[3].x_in_world, Eigen::Vector3d(1, 2, 3));
  EXPECT_THAT(scene.points[3].rgb, ElementsAre(10, 20, 30));
}

std::string WriteFresh(const std::string& name, const SceneFiles& files) {
  std::string folder = FreshFolder(name);
  WriteScene(folder, files);
  return folder;
}

Scene ImportFresh(const std::string& name, const SceneFiles& files) {
  const std::string folder = WriteFresh(name, files);
  const absl::StatusOr<Scene> scene = ImportScene(folder);
  EXPECT_TRUE(scene.ok()) << scene.status();
  return scene.ok() ? *scene : Scene();
}

absl::Status ImportError(const SceneFiles& files) {
  const std::string folder = WriteFresh("error", files);
  absl::Status status = ImportScene(folder).status();
  EXPECT_EQ(status.message().find('\n'), absl::string_view::npos) << status;
  return status;
}

std::string InvalidMessage(const SceneFiles& files) {
  const absl::Status status = ImportError(files);
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument) << status;
  return std::string(status.message());
}

TEST(ImportScene, ColmapText) {
  const Scene scene = ImportFresh("colmap_text", SmallColmapText());
  EXPECT_EQ(scene.format, "colmap-text");
  ExpectSmallPoses(scene);
  ExpectSmallColmapRest(scene);
}

TEST(ImportScene, ColmapBinary) {
  const Scene scene = ImportFresh("colmap_binary", SmallColmapBinary());
  EXPECT_EQ(scene.format, "colmap-binary");
  ExpectSmallPoses(scene);
  ExpectSmallColmapRest(scene);
}

TEST(ImportScene, Middlebury) {
  const Scene scene = ImportFresh("middlebury", SmallMiddlebury());
  EXPECT_EQ(scene.format, "middlebury");
  ExpectSmallPoses(scene);
  EXPECT_EQ(scene.views[0].lens.skew, 0.5);
  EXPECT_EQ(scene.views[0].lens.cx, 6.5);
}

TEST(ImportScene, Strecha) {
  const Scene scene = ImportFresh("strecha", SmallStrecha());
  EXPECT_EQ(scene.format, "strecha");
  ExpectSmallPoses(scene);
  EXPECT_EQ(scene.views[0].lens.skew, 0.5);
  EXPECT_EQ(scene.views[0].lens.cx, 6.5);
}

TEST(ImportScene, StrechaAllInOneFolder) {
  SceneFiles files;
  for (const auto& [name, bytes] : SmallStrecha()) files[std::filesystem::path(name).filename().string()] = bytes;
  ExpectSmallPoses(ImportFresh("strecha_flat", files));
}

TEST(ImportScene, ColmapLayouts) {
  for (const char* model : {"", "model", "sparse", "sparse/0"}) {
    for (const char* images : {"", "images"}) {
      SceneFiles files;
      for (const auto& [name, bytes] : SmallColmapText()) {
        const bool picture = name.find(".png") != std::string::npos;
        files[JoinPath(picture ? images : model, std::filesystem::path(name).filename().string())] = bytes;
      }
      ExpectSmallPoses(ImportFresh("layout", files));
    }
  }
}

TEST(ImportScene, TheModelsOwnFolderWillDo) {
  const std::string folder = WriteFresh("inner", SmallColmapBinary());
  EXPECT_TRUE(ImportScene(folder + "/sparse/0").ok());
  EXPECT_TRUE(ImportScene(folder + "/sparse/0/", {.format = "colmap-binary"}).ok());
}

TEST(ImportScene, BinaryWinsOverText) {
  SceneFiles files = SmallColmapText();
  for (const auto& [name, bytes] : SmallColmapBinary()) {
    files[name.find(".bin") == std::string::npos ? name : std::filesystem::path(name).filename().string()] = bytes;
  }
  const std::string folder = WriteFresh("both", files);
  EXPECT_EQ(ImportScene(folder).value().format, "colmap-binary");
  EXPECT_EQ(ImportScene(folder, {.format = "colmap-text"}).value().format, "colmap-text");
}

TEST(ImportScene, ImagesInSubfoldersAndNamesWithSpaces) {
  SceneFiles files = SmallColmapText();
  files["images.txt"] = ReplaceOnce(files["images.txt"], "a.png", "left row/a 1.png");
  files["images/left row/a 1.png"] = SmallPicture();
  const Scene scene = ImportFresh("subfolders", files);
  EXPECT_EQ(scene.views[2].name, "left row/a 1.png");
}

TEST(ImportScene, WindowsLineEndsAndNoLastLine) {
  SceneFiles files = SmallColmapText();
  for (const char* name : {"cameras.txt", "images.txt", "points3D.txt"}) {
    std::string text;
    for (const char c : files[name]) text += c == '\n' ? std::string("\r\n") : std::string(1, c);
    files[name] = text.substr(0, text.size() - 2);
  }
  ExpectSmallColmapRest(ImportFresh("windows", files));
}

TEST(ImportScene, TheOrderInFilesDoesNotMatter) {
  SceneFiles files = SmallColmapText();
  const Scene scene = ImportFresh("order", files);
  files["images.txt"] =
      "6 0 0 1 0 -1 0.5 2 3 c.png\n3 3 4\n"
      "5 0.70710678118654757 0.70710678118654757 0 0 1 2 3 7 a.png\n\n"
      "11 1 0 0 0 0 0 0 3 b.png\n1.5 2.5 4 2.5 3.5 -1 7 8 9\n";
  files["points3D.txt"] =
      "12 -1 0 4 1 2 3 0 6 0 11 0\n"
      "10 0 0 4 1 2 3 nan 11 0 6 0 5 0\n"
      "4 1 2 3 10 20 30 0.5 11 0 6 0\n"
      "9 -1 -2 4 11 21 31 0.25 5 17 11 2 11 1\n";
  const Scene other = ImportFresh("order", files);
  ASSERT_EQ(scene.points.size(), other.points.size());
  for (size_t i = 0; i < scene.points.size(); ++i) {
    EXPECT_EQ(scene.points[i].seen_by, other.points[i].seen_by);
    EXPECT_EQ(scene.points[i].x_in_world, other.points[i].x_in_world);
  }
  for (size_t i = 0; i < scene.views.size(); ++i) EXPECT_EQ(scene.views[i].name, other.views[i].name);
}

TEST(ImportScene, EveryColmapModel) {
  const std::pair<const char*, Lens::Model> models[] = {
      {"SIMPLE_PINHOLE 12 10 20 6 5", Lens::Model::kPinhole},
      {"SIMPLE_RADIAL 12 10 20 6 5 0.1", Lens::Model::kRadial},
      {"RADIAL 12 10 20 6 5 0.1 0.2", Lens::Model::kRadial},
      {"OPENCV_FISHEYE 12 10 20 21 6 5 0.1 0.2 0.3 0.4", Lens::Model::kOpenCvFisheye},
      {"FULL_OPENCV 12 10 20 21 6 5 0.1 0.2 0.01 0.02 0.03 0.04 0.05 0.06", Lens::Model::kFullOpenCv},
      {"FOV 12 10 20 21 6 5 0.9", Lens::Model::kFov},
      {"SIMPLE_RADIAL_FISHEYE 12 10 20 6 5 0.1", Lens::Model::kRadialFisheye},
      {"RADIAL_FISHEYE 12 10 20 6 5 0.1 0.2", Lens::Model::kRadialFisheye},
      {"THIN_PRISM_FISHEYE 12 10 20 21 6 5 0.1 0.2 0.01 0.02 0.03 0.04 0.05 0.06", Lens::Model::kThinPrismFisheye},
      {"RAD_TAN_THIN_PRISM_FISHEYE 12 10 20 21 6 5 0.1 0.2 0.01 0 0 0 0.001 0.001 0.001 0.001 0.001 0.001",
       Lens::Model::kRadTanThinPrismFisheye},
      {"SIMPLE_DIVISION 12 10 20 6 5 0.1", Lens::Model::kDivision},
      {"DIVISION 12 10 20 21 6 5 0.1", Lens::Model::kDivision},
      {"EUCM 12 10 20 21 6 5 0.1 1.1", Lens::Model::kEucm}};
  for (const auto& [line, model] : models) {
    SceneFiles files = SmallColmapText();
    files["cameras.txt"] = "3 PINHOLE 12 10 20 21 6 5\n7 " + std::string(line) + "\n";
    const Lens lens = ImportFresh("models", files).views.at(0).lens;
    EXPECT_EQ(lens.model, model) << line;
    EXPECT_EQ(std::tie(lens.fx, lens.cx, lens.cy), std::make_tuple(20.0, 6.0, 5.0)) << line;
    if (model == Lens::Model::kFov) {
      EXPECT_EQ(lens.coefficients[0], 0.9);
    } else if (model == Lens::Model::kFullOpenCv || model == Lens::Model::kThinPrismFisheye) {
      EXPECT_THAT(lens.coefficients, ElementsAre(0.1, 0.2, 0.01, 0.02, 0.03, 0.04, 0.05, 0.06, 0, 0, 0, 0));
    } else if (model != Lens::Model::kPinhole) {
      EXPECT_EQ(lens.coefficients[0], 0.1);
    }
    std::string& cameras = files["cameras.txt"];
    cameras = cameras.substr(0, cameras.find_last_of(' '));
    EXPECT_THAT(InvalidMessage(files), HasSubstr("cameras.txt, line 2: ends early; expected PARAMS"));
  }
}

TEST(ImportScene, ErrorsNameFileLineFieldValueAndExpectation) {
  const auto text = [](const std::string& file, const std::string& from, const std::string& to) {
    SceneFiles files = SmallColmapText();
    files[file] = ReplaceOnce(files[file], from, to);
    return InvalidMessage(files);
  };
  EXPECT_THAT(text("cameras.txt", "20 21 6", "nan 21 6"),
              HasSubstr("cameras.txt, line 2: PARAMS is \"nan\"; expected a finite number"));
  EXPECT_THAT(text("cameras.txt", "OPENCV", "EQUIRECTANGULAR"),
              HasSubstr("cameras.txt, line 3: MODEL is \"EQUIRECTANGULAR\"; expected one of SIMPLE_PINHOLE"));
  EXPECT_THAT(text("cameras.txt", "12 10", "-12 10"), HasSubstr("line 2: WIDTH is \"-12\"; expected an integer"));
  EXPECT_THAT(text("cameras.txt", "12 10", "900000 900000"), HasSubstr("line 2: image size is 900000 x 900000"));
  EXPECT_THAT(text("cameras.txt", "20 21", "0 21"), HasSubstr("line 2: focal length is 0, 21 px; expected"));
  EXPECT_THAT(text("cameras.txt", "6 5", "6 1e300"), HasSubstr("line 2: principal point is 6, 1e+300 px; expected"));
  EXPECT_THAT(text("cameras.txt", "0.01 -0.02", "0.01 -1e12"), HasSubstr("line 3: what the distortion leaves of"));
  EXPECT_THAT(text("cameras.txt", "7 OPENCV", "3 OPENCV"),
              HasSubstr("line 3: CAMERA_ID is 3; expected an id not used"));
  EXPECT_THAT(text("cameras.txt", "7 OPENCV", "8 OPENCV"), HasSubstr("images.txt, line 5: CAMERA_ID is 7; expected"));
  EXPECT_THAT(text("images.txt", "11 1 0", "11 2 0"), HasSubstr("line 3: length of the quaternion is 2; expected 1"));
  EXPECT_THAT(text("images.txt", "0 0 0 3 b", "0 0 inf 3 b"), HasSubstr("line 3: TZ is \"inf\"; expected a finite"));
  EXPECT_THAT(
      text("images.txt", "a.png", "b.png"),
      AllOf(HasSubstr("line 5: image name is \"b.png\"; expected a name not used before"), HasSubstr("line 3")));
  EXPECT_THAT(text("images.txt", "a.png", "../../a.png"), HasSubstr("expected a path within the folder"));
  EXPECT_THAT(text("images.txt", "a.png", "/a.png"), HasSubstr("expected a path within the folder"));
  EXPECT_THAT(text("images.txt", "\n\n6", "\n6"), HasSubstr("every image has two lines"));
  EXPECT_THAT(text("images.txt", "5 0.7", "11 0.7"), HasSubstr("IMAGE_ID is 11; expected an id not used"));
  EXPECT_THAT(text("points3D.txt", "6 0\n9", "66 0\n9"),
              HasSubstr("points3D.txt, line 2: IMAGE_ID in the track is 66"));
  EXPECT_THAT(text("points3D.txt", "17 11 2", "17 11 3"),
              HasSubstr("line 3: POINT2D_IDX in the track is 3; expected less"));
  EXPECT_THAT(text("points3D.txt", "10 20 30", "10 256 30"), HasSubstr("line 2: G is \"256\"; expected an integer"));

  const auto middlebury = [](const std::string& from, const std::string& to) {
    SceneFiles files = SmallMiddlebury();
    files["small_par.txt"] = ReplaceOnce(files["small_par.txt"], from, to);
    return InvalidMessage(files);
  };
  EXPECT_THAT(middlebury("3\n", "4\n"), HasSubstr("small_par.txt: 3 images; expected 4 as its first line says"));
  EXPECT_THAT(middlebury("3\n", "x\n"), HasSubstr("line 1: number of images is \"x\"; expected an integer"));
  EXPECT_THAT(middlebury("1 0 0 0 1 0 0 0 1 0 0 0", "1 0 0 0 1 0 0 0 2 0 0 0"),
              HasSubstr("line 2: largest entry of R"));
  EXPECT_THAT(middlebury("1 0 0 0 1 0 0 0 1 0 0 0", "1 0 0 0 1 0 0 0 -1 0 0 0"), HasSubstr("not a mirror"));
  EXPECT_THAT(middlebury("0 21 4.5", "3 21 4.5"), HasSubstr("line 2: K is not of the form"));
  EXPECT_THAT(middlebury("b.png 20", "b.png -20"), HasSubstr("line 2: focal length in K is -20, 21 px"));
  EXPECT_THAT(middlebury("0 0 0\n", "0 0 0 9\n"), HasSubstr("line 2: goes on with \"9\"; expected the end"));

  const auto strecha = [](const std::string& from, const std::string& to) {
    SceneFiles files = SmallStrecha();
    files["cameras/b.png.camera"] = ReplaceOnce(files["cameras/b.png.camera"], from, to);
    return InvalidMessage(files);
  };
  EXPECT_THAT(strecha("0 0 0\n1 0 0", "0.1 0 0\n1 0 0"), HasSubstr("b.png.camera, line 4: row after K is 0.1"));
  EXPECT_THAT(strecha("12 10", "12"), HasSubstr("b.png.camera, line 10: ends early; expected height"));
  EXPECT_THAT(strecha("12 10", "12 0"), HasSubstr("line 9: height is \"0\"; expected an integer from 1"));
}

TEST(ImportScene, ScenesWithoutCameras) {
  SceneFiles files = SmallColmapText();
  files["cameras.txt"] = files["images.txt"] = files["points3D.txt"] = "# nothing\n";
  EXPECT_THAT(InvalidMessage(files), HasSubstr("images.txt: no cameras; expected at least one"));
  files = SmallMiddlebury();
  files["small_par.txt"] = "0\n";
  EXPECT_THAT(InvalidMessage(files), HasSubstr("small_par.txt: no cameras; expected at least one"));
  files["small_par.txt"] = "";
  EXPECT_THAT(InvalidMessage(files), HasSubstr("small_par.txt: empty"));
}

TEST(ImportScene, PicturesThatAreMissingOrDoNotFit) {
  for (const SceneFiles& files : {SmallColmapText(), SmallColmapBinary(), SmallMiddlebury(), SmallStrecha()}) {
    const std::string picture = files.contains("c.png") ? "c.png" : "images/c.png";
    SceneFiles damaged = files;
    damaged.erase(picture);
    absl::Status status = ImportError(damaged);
    EXPECT_EQ(status.code(), absl::StatusCode::kNotFound);
    EXPECT_THAT(std::string(status.message()), AllOf(HasSubstr("c.png: no such image"), HasSubstr("named at")));

    damaged[picture] = "no picture";
    EXPECT_THAT(InvalidMessage(damaged), HasSubstr("c.png: not a JPEG"));

    damaged = files;
    std::erase_if(damaged, [](const auto& file) { return file.first.ends_with(".png"); });
    status = ImportError(damaged);
    EXPECT_EQ(status.code(), absl::StatusCode::kNotFound);
    EXPECT_THAT(std::string(status.message()), HasSubstr("image \"a.png\" not found; looked in"));
  }
  SceneFiles files = SmallStrecha();
  files["cameras/c.png.camera"] = ReplaceOnce(files["cameras/c.png.camera"], "12 10", "10 12");
  EXPECT_THAT(InvalidMessage(files),
              AllOf(HasSubstr("images/c.png: the picture has 12 x 10 px; its camera ("), HasSubstr("expects 10 x 12")));
}

TEST(ImportScene, CountsThatLieAllocateNothing) {
  for (const char* name : {"sparse/0/cameras.bin", "sparse/0/images.bin", "sparse/0/points3D.bin"}) {
    SceneFiles files = SmallColmapBinary();
    files[name].replace(0, 8, std::string("\0\0\0\0\0\0\0\x10", 8));  // 2^60
    EXPECT_THAT(InvalidMessage(files),
                AllOf(HasSubstr(name), HasSubstr("is 1152921504606846976; expected at most"), HasSubstr("number of")));
  }
  SceneFiles files = SmallColmapBinary();
  std::string& points = files["sparse/0/points3D.bin"];
  points.replace(8 + 43, 8, std::string("\xFF\xFF\xFF\xFF\xFF\xFF\xFF\xFF", 8));  // track length of the first point
  EXPECT_THAT(InvalidMessage(files), HasSubstr("points3D.bin, record 1: track length is 18446744073709551615"));
  files = SmallColmapBinary();
  files["sparse/0/cameras.bin"][12] = 17;
  EXPECT_THAT(InvalidMessage(files),
              HasSubstr("cameras.bin, record 1: camera model is number 17; expected one of those known"));
  files = SmallColmapBinary();
  files["sparse/0/images.bin"] += 'x';
  EXPECT_THAT(InvalidMessage(files), HasSubstr("images.bin, record 3: 1 bytes follow the last record"));
}

TEST(ImportScene, SaysWhatItLookedFor) {
  const std::string folder = FreshFolder("nothing");
  absl::Status status = ImportScene(folder).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(status.message()),
              AllOf(HasSubstr("cameras.bin"), HasSubstr("cameras.txt"), HasSubstr("*_par.txt"), HasSubstr("*.camera")));
  status = ImportScene(folder, {.format = "middlebury"}).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kNotFound);
  EXPECT_THAT(std::string(status.message()), HasSubstr("no middlebury scene; expected *_par.txt"));
  status = ImportScene(folder, {.format = "polycam"}).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(status.message()), HasSubstr("format is \"polycam\"; expected one of colmap-binary"));
  EXPECT_EQ(ImportScene(folder + "/none").status().code(), absl::StatusCode::kNotFound);
  WriteScene(folder, {{"file", "x"}});
  EXPECT_EQ(ImportScene(folder + "/file").status().code(), absl::StatusCode::kInvalidArgument);
}

TEST(ImportScene, OfTwoFormatsTheFirstIsTakenAndTheOtherNamed) {
  SceneFiles files = SmallColmapText();
  files.merge(SmallMiddlebury());
  const Scene scene = ImportFresh("two", files);
  EXPECT_EQ(scene.format, "colmap-text");
  EXPECT_THAT(scene.warnings, ElementsAre(HasSubstr("also looks like middlebury")));
  const absl::StatusOr<Scene> forced = ImportScene(WriteFresh("two", files), {.format = "middlebury"});
  ASSERT_TRUE(forced.ok()) << forced.status();
  EXPECT_EQ(forced->format, "middlebury");
  EXPECT_THAT(forced->warnings, IsEmpty());
}

TEST(ImportScene, AByteOrderMarkIsSkipped) {
  for (SceneFiles files : {SmallColmapText(), SmallMiddlebury(), SmallStrecha()}) {
    for (auto& [name, bytes] : files) {
      if (!name.ends_with(".png")) bytes.insert(0, "\xEF\xBB\xBF");
    }
    // Also where no comment stands before the first record.
    if (files.contains("cameras.txt")) files["cameras.txt"] = ReplaceOnce(files["cameras.txt"], "# Camera list\n", "");
    ExpectSmallPoses(ImportFresh("mark", files));
  }
}

// sparse/0 with two of the photographs, sparse/1 with all three.
SceneFiles TwoColmapModels() {
  SceneFiles files;
  for (const auto& [name, bytes] : SmallColmapText()) {
    if (name.ends_with(".png")) {
      files[name] = bytes;
      continue;
    }
    for (const char* model : {"sparse/0/", "sparse/1/"}) files[model + name] = bytes;
  }
  files["sparse/0/images.txt"] = ReplaceOnce(files["sparse/0/images.txt"], "6 0 0 1 0 -1 0.5 2e0 3 c.png\n3 3 4\n", "");
  files["sparse/0/points3D.txt"] = "";
  return files;
}

TEST(ImportScene, OfSeveralColmapModelsTheLargestIsTakenAndTheOthersNamed) {
  const std::string folder = WriteFresh("models", TwoColmapModels());
  const absl::StatusOr<Scene> scene = ImportScene(folder);
  ASSERT_TRUE(scene.ok()) << scene.status();
  ExpectSmallPoses(*scene);
  EXPECT_THAT(scene->warnings, ElementsAre(AllOf(HasSubstr("sparse/0 (2 photographs)"), HasSubstr("--model 0"))));
  const absl::StatusOr<Scene> other = ImportScene(folder, {.model = 0});
  ASSERT_TRUE(other.ok()) << other.status();
  EXPECT_EQ(other->views.size(), 2);
  EXPECT_THAT(other->warnings, ElementsAre(HasSubstr("sparse/1 (3 photographs)")));
  const absl::Status none = ImportScene(folder, {.model = 7}).status();
  EXPECT_EQ(none.code(), absl::StatusCode::kNotFound);
  EXPECT_THAT(std::string(none.message()), HasSubstr("model is 7; expected one of 0, 1"));
}

TEST(ImportScene, FilesOfRigsAndFramesChangeNothing) {
  SceneFiles files = SmallColmapBinary();
  for (const char* name : {"rigs.bin", "frames.bin"}) files[std::string("sparse/0/") + name] = "not read";
  const Scene scene = ImportFresh("rigs", files);
  ExpectSmallPoses(scene);
  ExpectSmallColmapRest(scene);
}

TEST(ImportScene, PhotographsOfTheFolderAboveAreAnotherScenes) {
  SceneFiles files;
  for (const auto& [name, bytes] : SmallColmapText()) {
    if (!name.ends_with(".png")) {
      files["A/" + name] = bytes;
      continue;
    }
    files[name] = bytes;  // images/ of the other scene
    files["A/photos/" + std::filesystem::path(name).filename().string()] = bytes;
  }
  const std::string folder = WriteFresh("parent", files);
  const absl::Status status = ImportScene(folder + "/A").status();
  EXPECT_EQ(status.code(), absl::StatusCode::kNotFound);
  EXPECT_THAT(std::string(status.message()), AllOf(HasSubstr("image \"a.png\" not found"), HasSubstr("--images")));
  const absl::StatusOr<Scene> told = ImportScene(folder + "/A", {.images_folder = folder + "/A/photos"});
  ASSERT_TRUE(told.ok()) << told.status();
  EXPECT_EQ(told->views[0].image_path, JoinPath(folder, "A/photos/a.png"));
  EXPECT_EQ(ImportScene(folder + "/A", {.images_folder = folder + "/none"}).status().code(),
            absl::StatusCode::kNotFound);
}

TEST(ImportScene, StrechaAsPublished) {
  SceneFiles files;
  for (const auto& [name, bytes] : SmallStrecha()) {
    const std::string base = std::filesystem::path(name).filename().string();
    files[(base.ends_with(".camera") ? "gt_dense_cameras/" : "images/") + base] = bytes;
  }
  ExpectSmallPoses(ImportFresh("published", files));
}

TEST(ImportScene, AFewMissingPhotographsCostTheirCamerasOnly) {
  SceneFiles files = SmallColmapText();
  files["images.txt"] += "20 1 0 0 0 1 0 0 3 d.png\n\n";
  files["points3D.txt"] += "30 0 0 5 1 2 3 0 20 0 11 0\n";
  const Scene scene = ImportFresh("missing", files);
  ASSERT_EQ(scene.views.size(), 3);
  EXPECT_THAT(scene.warnings, ElementsAre(AllOf(HasSubstr("1 of 4 cameras"), HasSubstr("d.png"))));
  for (const SparsePoint& point : scene.points) {
    for (const CameraIndex camera : point.seen_by) EXPECT_LT(camera, 3);
  }
}

TEST(ImportScene, PicturesAreFoundWhateverTheCaseOrFolderOfTheirNames) {
  SceneFiles files = SmallColmapText();
  files["images.txt"] = ReplaceOnce(files["images.txt"], "a.png", "elsewhere/A.PNG");
  const Scene scene = ImportFresh("case", files);
  EXPECT_THAT(scene.views[2].image_path, EndsWith("images/a.png"));
  files["a.png"] = SmallPicture();
  EXPECT_THAT(InvalidMessage(files), HasSubstr("expected one picture, not both"));
}

TEST(ImportScene, NamesAreMadeUtf8AndFilesFoundByTheirBytes) {
  SceneFiles files = SmallColmapText();
  files["images.txt"] = ReplaceOnce(files["images.txt"], "c.png", "caf\xE9.png");
  files["images/caf\xE9.png"] = SmallPicture();
  const Scene scene = ImportFresh("bytes", files);
  EXPECT_EQ(scene.views[2].name, "caf%E9.png");
  EXPECT_THAT(scene.views[2].image_path, EndsWith("images/caf\xE9.png"));
  // Two names must not become one.
  files["images.txt"] = ReplaceOnce(files["images.txt"], "b.png", "caf%E9.png");
  files["images/caf%E9.png"] = SmallPicture();
  EXPECT_THAT(InvalidMessage(files), HasSubstr("expected a name not used before"));
}

TEST(ImportScene, PathsOfOtherMachines) {
  EXPECT_EQ(PortableImageName("C:\\photos\\a.png"), "a.png");
  EXPECT_EQ(PortableImageName("/home/x/a.png"), "a.png");
  EXPECT_EQ(PortableImageName("../images/a.png"), "a.png");
  EXPECT_EQ(PortableImageName("./left\\a.png"), "left/a.png");
}

TEST(ImportScene, CoordinatesFarFromZeroGetAnOffset) {
  const std::string folder = WriteFresh("far", SmallColmapText());
  const Scene near = ImportScene(folder).value();
  EXPECT_TRUE(near.offset.isZero(0));
  for (const Eigen::Vector3d& by : {Eigen::Vector3d(500000, 4000000, 0), Eigen::Vector3d(4121900, 652900, -4797700)}) {
    Scene moved = near;
    moved.offset = by;
    ASSERT_TRUE(ExportColmapText(moved, folder).ok());
    const absl::StatusOr<Scene> far = ImportScene(folder);
    ASSERT_TRUE(far.ok()) << far.status();
    EXPECT_EQ(far->offset, by);
    for (size_t i = 0; i < near.views.size(); ++i) {
      const Rigid3& a = far->views[i].cam_from_world;
      const Rigid3& b = near.views[i].cam_from_world;
      EXPECT_LT((a.translation - b.translation).norm(), 1e-8);
    }
    for (size_t i = 0; i < near.points.size(); ++i) {
      EXPECT_LT((far->points[i].x_in_world - near.points[i].x_in_world).norm(), 1e-8);
    }
  }
}

TEST(ImportScene, MasksAreFoundByTheirNames) {
  SceneFiles files = SmallColmapText();
  files["masks/a.png.png"] = SmallPicture();    // COLMAP
  files["masks/b.png"] = SmallPicture();        // by the stem
  files["images/c_mask.png"] = SmallPicture();  // OpenDroneMap
  files["masks/d.png.png"] = SmallPicture();    // of no photograph
  const Scene scene = ImportFresh("masks", files);
  EXPECT_THAT(scene.views[0].mask_path, EndsWith("masks/a.png.png"));
  EXPECT_THAT(scene.views[1].mask_path, EndsWith("masks/b.png"));
  EXPECT_THAT(scene.views[2].mask_path, EndsWith("images/c_mask.png"));
  EXPECT_THAT(scene.warnings, ElementsAre(AllOf(HasSubstr("1 masks belong to no photograph"), HasSubstr("d.png.png"))));
  EXPECT_EQ(ImportFresh("no_masks", SmallColmapText()).views[0].mask_path, "");

  const std::string folder = WriteFresh("masks", files);
  WriteScene(folder, {{"elsewhere/a_mask.jpg", "x"}});
  const absl::StatusOr<Scene> told = ImportScene(folder, {.masks_folder = folder + "/elsewhere"});
  ASSERT_TRUE(told.ok()) << told.status();
  EXPECT_THAT(told->views[0].mask_path, EndsWith("elsewhere/a_mask.jpg"));
  EXPECT_EQ(told->views[1].mask_path, "");
  EXPECT_EQ(ImportScene(folder, {.masks_folder = folder + "/none"}).status().code(), absl::StatusCode::kNotFound);
  WriteScene(folder, {{"other/z.png", SmallPicture()}});
  EXPECT_EQ(ImportScene(folder, {.masks_folder = folder + "/other"}).status().code(), absl::StatusCode::kNotFound);
}

TEST(ImportScene, TheRegionIsReadFromItsFile) {
  SceneFiles files = SmallColmapText();
  files["region.json"] = "[0, 1, 2, 4, 3, 3]";
  const Scene scene = ImportFresh("region", files);
  ASSERT_TRUE(scene.region.has_value());
  EXPECT_EQ(scene.region->center, Eigen::Vector3d(2, 2, 2.5));
  EXPECT_EQ(scene.region->size, Eigen::Vector3d(4, 2, 1));
  EXPECT_THAT(scene.warnings, ElementsAre(HasSubstr("--region none")));
  const std::string folder = WriteFresh("region", files);
  EXPECT_FALSE(ImportScene(folder, {.region = "none"})->region.has_value());
  WriteScene(folder,
             {{"box.json", R"({"center": [1, 1, 1], "axes": [[0, 1, 0], [-1, 0, 0], [0, 0, 1]], "size": [1, 2, 3]})"}});
  const absl::StatusOr<Scene> told = ImportScene(folder, {.region = folder + "/box.json"});
  ASSERT_TRUE(told.ok()) << told.status();
  EXPECT_TRUE(told->region->Contains({0.1, 1.4, 0}));  // y is the box's first direction, of length 1
  EXPECT_FALSE(told->region->Contains({1.4, 1.6, 0}));

  for (const auto& [text, expected] : {std::pair<const char*, const char*>{"[0, 1, 2, 4, 3]", "6 finite numbers"},
                                       {"[0, 0, 0, 1, -1, 1]", "size is 1, -1, 1; expected three lengths more than 0"},
                                       {"{\"center\": [1, 2, 3]}", "size is missing"},
                                       {"{", "is not valid JSON"}}) {
    files["region.json"] = text;
    EXPECT_THAT(InvalidMessage(files), AllOf(HasSubstr("region.json"), HasSubstr(expected)));
  }
}

TEST(ExportColmapText, ReadsBackTheSame) {
  const std::string folder = WriteFresh("export", SmallColmapBinary());
  const Scene scene = ImportScene(folder).value();
  ASSERT_TRUE(ExportColmapText(scene, folder + "/model").ok());
  const absl::StatusOr<Scene> read = ImportScene(folder, {.format = "colmap-text"});
  ASSERT_TRUE(read.ok()) << read.status();
  ExpectSmallPoses(*read);
  ExpectSmallColmapRest(*read);
}

TEST(ExportColmapText, RefusesWhatColmapCannotSay) {
  const Scene scene = ImportFresh("export_skew", SmallMiddlebury());
  const absl::Status status = ExportColmapText(scene, FreshFolder("export_skew_out"));
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(status.message()), HasSubstr("a.png: skew is 0.5 px; expected 0"));
}

}  // namespace
}  // namespace meshwright
