// SPDX-License-Identifier: Apache-2.0
#include "common/scene/formats/openmvs.h"

#include <algorithm>
#include <array>
#include <filesystem>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <absl/strings/str_cat.h>

#include "common/base/files.h"
#include "common/base/status_macros.h"
#include "common/scene/formats/assemble.h"
#include "common/scene/formats/binary_fields.h"
#include "common/scene/formats/calibration_matrix.h"
#include "common/scene/formats/lens_and_pose.h"

namespace meshwright {
namespace {

constexpr uint32_t kNewest = 7;
constexpr uint32_t kNone = 0xFFFFFFFF;

// Bytes that a record takes at least.
constexpr uint64_t kPlatformBytes = 3 * 8;
constexpr uint64_t kCameraBytes = 8 + (9 + 9 + 3) * 8;
constexpr uint64_t kPoseBytes = (9 + 3) * 8;
constexpr uint64_t kImageBytes = 8 + 3 * 4;
constexpr uint64_t kVertexBytes = 3 * 4 + 8;
constexpr uint64_t kVertexViewBytes = 2 * 4;

struct PlatformCamera {
  uint32_t width = 0;  // 0: K is divided by the longer side
  uint32_t height = 0;
  Eigen::Matrix3d k;
  Rigid3 cam_from_platform;
};

struct Platform {
  std::vector<PlatformCamera> cameras;
  std::vector<Rigid3> platform_from_world;
};

class MvsReader {
 public:
  MvsReader(const std::string& bytes, const std::string& file) : fields_(bytes, file) {}

  absl::Status Read(ImportedScene* scene) {
    MW_RETURN_IF_ERROR(ReadHeader());
    MW_ASSIGN_OR_RETURN(const uint64_t platforms, fields_.Count("number of platforms", kPlatformBytes));
    for (uint64_t i = 0; i < platforms; ++i) {
      fields_.NextRecord();
      MW_ASSIGN_OR_RETURN(Platform platform, ReadPlatform());
      platforms_.push_back(std::move(platform));
    }
    MW_ASSIGN_OR_RETURN(const uint64_t images, fields_.Count("number of images", kImageBytes));
    for (uint64_t i = 0; i < images; ++i) {
      fields_.NextRecord();
      MW_RETURN_IF_ERROR(ReadImage(scene));
    }
    if (scene->views.size() < images) {
      scene->warnings.push_back(
          absl::StrCat(images - scene->views.size(), " of ", images, " photographs have no pose"));
    }
    return ReadVertices(scene);
  }

 private:
  absl::Status ReadHeader() {
    using Magic = std::array<char, 4>;
    MW_ASSIGN_OR_RETURN(const Magic magic, fields_.Read<Magic>("MVSI"));
    const std::string name(magic.data(), magic.size());
    if (name == std::string("MVS\0", 4)) {
      return FieldError(fields_.place(), "magic", "that of a project of one build of OpenMVS",
                        "MVSI, which --archive-type -1 writes");
    }
    if (name != "MVSI") return FieldError(fields_.place(), "magic", Quoted(name), "MVSI");
    MW_ASSIGN_OR_RETURN(version_, fields_.Read<uint32_t>("version"));
    if (version_ > kNewest) {
      return FieldError(fields_.place(), "version", absl::StrCat(version_), absl::StrCat("at most ", kNewest));
    }
    return fields_.Read<uint32_t>("reserved").status();
  }

  absl::StatusOr<Eigen::Matrix3d> ReadMatrix(const char* field) {
    Eigen::Matrix3d matrix;
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 3; ++column) {
        MW_ASSIGN_OR_RETURN(matrix(row, column), fields_.Number(field));
      }
    }
    return matrix;
  }

  absl::StatusOr<Rigid3> ReadPose() {
    MW_ASSIGN_OR_RETURN(const Eigen::Matrix3d matrix, ReadMatrix("R"));
    MW_ASSIGN_OR_RETURN(const Eigen::Matrix3d rotation, NearestRotation(matrix, fields_.place()));
    Eigen::Vector3d center;
    for (double& component : center) {
      MW_ASSIGN_OR_RETURN(component, fields_.Number("C"));
    }
    return PoseFromCenter(rotation, center);
  }

  absl::StatusOr<Platform> ReadPlatform() {
    Platform platform;
    MW_RETURN_IF_ERROR(fields_.Text("name of a platform").status());
    MW_ASSIGN_OR_RETURN(const uint64_t cameras, fields_.Count("number of cameras", kCameraBytes));
    for (uint64_t i = 0; i < cameras; ++i) {
      PlatformCamera camera;
      MW_RETURN_IF_ERROR(fields_.Text("name of a camera").status());
      if (version_ > 3) MW_RETURN_IF_ERROR(fields_.Text("band").status());
      if (version_ > 0) {
        MW_ASSIGN_OR_RETURN(camera.width, fields_.Read<uint32_t>("width"));
        MW_ASSIGN_OR_RETURN(camera.height, fields_.Read<uint32_t>("height"));
      }
      MW_ASSIGN_OR_RETURN(camera.k, ReadMatrix("K"));
      MW_ASSIGN_OR_RETURN(camera.cam_from_platform, ReadPose());
      platform.cameras.push_back(std::move(camera));
    }
    MW_ASSIGN_OR_RETURN(const uint64_t poses, fields_.Count("number of poses", kPoseBytes));
    for (uint64_t i = 0; i < poses; ++i) {
      MW_ASSIGN_OR_RETURN(const Rigid3 pose, ReadPose());
      platform.platform_from_world.push_back(pose);
    }
    return platform;
  }

  absl::Status ReadImage(ImportedScene* scene) {
    MW_ASSIGN_OR_RETURN(const std::string name, fields_.Text("name of an image"));
    if (version_ > 4) MW_RETURN_IF_ERROR(fields_.Text("name of a mask").status());
    MW_ASSIGN_OR_RETURN(const auto platform_id, fields_.Read<uint32_t>("platform"));
    MW_ASSIGN_OR_RETURN(const auto camera_id, fields_.Read<uint32_t>("camera"));
    MW_ASSIGN_OR_RETURN(const auto pose_id, fields_.Read<uint32_t>("pose"));
    if (version_ > 2) MW_RETURN_IF_ERROR(fields_.Read<uint32_t>("id").status());
    if (version_ > 6) {
      constexpr uint64_t kScoreBytes = 6 * 4;
      for (int i = 0; i < 3; ++i) MW_RETURN_IF_ERROR(fields_.Read<float>("depth").status());
      MW_ASSIGN_OR_RETURN(const uint64_t scores, fields_.Count("number of view scores", kScoreBytes));
      fields_.Skip(scores * kScoreBytes);
    }
    camera_of_image_.push_back(-1);
    if (pose_id == kNone) return absl::OkStatus();
    const bool known = platform_id < platforms_.size() && camera_id < platforms_[platform_id].cameras.size() &&
                       pose_id < platforms_[platform_id].platform_from_world.size();
    if (!known) {
      return FieldError(fields_.place(), "platform, camera and pose",
                        absl::StrCat(platform_id, ", ", camera_id, ", ", pose_id), "those of the platforms");
    }
    const PlatformCamera& camera = platforms_[platform_id].cameras[camera_id];
    ImportedView imported{.view = {.name = PortableImageName(name)}, .named_at = fields_.place()};
    imported.view.cam_from_world = camera.cam_from_platform * platforms_[platform_id].platform_from_world[pose_id];
    MW_RETURN_IF_ERROR(ReadLens(camera, &imported));
    camera_of_image_.back() = static_cast<CameraIndex>(scene->views.size());
    scene->views.push_back(std::move(imported));
    return absl::OkStatus();
  }

  static absl::Status ReadLens(const PlatformCamera& camera, ImportedView* imported) {
    const Place place = imported->named_at;
    if (camera.width == 0 || camera.height == 0) {
      imported->lens_of_size = [k = camera.k, place](int width, int height) {
        const double size = std::max(width, height);
        return LensFromCalibrationMatrix(Eigen::Vector3d(size, size, 1).asDiagonal() * k, place);
      };
      return absl::OkStatus();
    }
    constexpr uint32_t kLargestSide = 1'000'000;  // px; CheckLens holds the product
    if (camera.width > kLargestSide || camera.height > kLargestSide) {
      return FieldError(place, "image size", absl::StrCat(camera.width, " x ", camera.height),
                        absl::StrCat("sizes up to ", kLargestSide, " px"));
    }
    MW_ASSIGN_OR_RETURN(imported->view.lens, LensFromCalibrationMatrix(camera.k, place));
    imported->view.lens.width = static_cast<int>(camera.width);
    imported->view.lens.height = static_cast<int>(camera.height);
    return CheckLens(imported->view.lens, place);
  }

  absl::Status ReadVertices(ImportedScene* scene) {
    MW_ASSIGN_OR_RETURN(const uint64_t vertices, fields_.Count("number of vertices", kVertexBytes));
    for (uint64_t i = 0; i < vertices; ++i) {
      fields_.NextRecord();
      SparsePoint point;
      for (double& component : point.x_in_world) {
        MW_ASSIGN_OR_RETURN(component, fields_.Read<float>("vertex"));
      }
      if (!point.x_in_world.allFinite()) return FieldError(fields_.place(), "vertex", "not finite", "finite numbers");
      MW_ASSIGN_OR_RETURN(const uint64_t views, fields_.Count("number of views", kVertexViewBytes));
      for (uint64_t k = 0; k < views; ++k) {
        MW_ASSIGN_OR_RETURN(const auto image, fields_.Read<uint32_t>("image of a vertex"));
        MW_RETURN_IF_ERROR(fields_.Read<float>("confidence").status());
        if (image >= camera_of_image_.size()) {
          return FieldError(fields_.place(), "image of a vertex", absl::StrCat(image),
                            absl::StrCat("less than the number of images, ", camera_of_image_.size()));
        }
        if (camera_of_image_[image] >= 0) point.seen_by.push_back(camera_of_image_[image]);
      }
      scene->points.push_back(std::move(point));
    }
    constexpr uint64_t kNormalBytes = 3 * 4;
    constexpr uint64_t kColorBytes = 3;
    MW_ASSIGN_OR_RETURN(const uint64_t normals, fields_.Count("number of normals", kNormalBytes));
    fields_.Skip(normals * kNormalBytes);
    MW_ASSIGN_OR_RETURN(const uint64_t colors, fields_.Count("number of colours", kColorBytes));
    for (uint64_t i = 0; i < colors; ++i) {
      using Bgr = std::array<uint8_t, 3>;
      MW_ASSIGN_OR_RETURN(const Bgr bgr, fields_.Read<Bgr>("colour"));
      if (i < scene->points.size()) scene->points[i].rgb = {bgr[2], bgr[1], bgr[0]};
    }
    return absl::OkStatus();  // lines, transform and box are not used
  }

  BinaryFields fields_;
  uint32_t version_ = 0;
  std::vector<Platform> platforms_;
  std::vector<CameraIndex> camera_of_image_;  // -1: without a pose
};

}  // namespace

absl::StatusOr<Scene> ImportOpenMvs(const std::string& file, const ImportOptions& options) {
  MW_ASSIGN_OR_RETURN(const std::string bytes, ReadFile(file));
  const std::string folder = std::filesystem::path(file).parent_path().string();
  ImportedScene scene{
      .format = "openmvs", .file = file, .image_folders = {JoinPath(folder, ""), JoinPath(folder, "images")}};
  MW_RETURN_IF_ERROR(MvsReader(bytes, file).Read(&scene));
  return AssembleScene(std::move(scene), options);
}

}  // namespace meshwright
