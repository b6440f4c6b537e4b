// SPDX-License-Identifier: Apache-2.0
#include "common/scene/formats/blocks_exchange.h"

#include <algorithm>
#include <array>
#include <filesystem>
#include <map>
#include <utility>
#include <vector>

#include <absl/strings/str_cat.h>

#include "common/base/status_macros.h"
#include "common/scene/formats/assemble.h"
#include "common/scene/formats/lens_and_pose.h"
#include "common/scene/formats/xml_fields.h"

namespace meshwright {
namespace {

class BlockReader {
 public:
  BlockReader(const XmlFields& fields, ImportedScene* scene) : fields_(fields), scene_(*scene) {}

  absl::Status Read(const XmlElement& block) {
    MW_ASSIGN_OR_RETURN(const XmlElement* groups, fields_.Child(block, "Photogroups"));
    for (const XmlElement& group : groups->children) {
      if (group.name == "Photogroup") MW_RETURN_IF_ERROR(ReadGroup(group));
    }
    if (const XmlElement* points = block.Find("TiePoints"); points != nullptr) {
      for (const XmlElement& point : points->children) {
        if (point.name == "TiePoint") MW_RETURN_IF_ERROR(ReadPoint(point));
      }
    }
    if (skipped_ > 0) scene_.warnings.push_back(absl::StrCat(skipped_, " photographs have no pose"));
    return absl::OkStatus();
  }

 private:
  absl::Status ExpectText(const XmlElement& element, const char* name, const char* expected) const {
    if (element.Find(name) == nullptr) return absl::OkStatus();
    MW_ASSIGN_OR_RETURN(const std::string text, fields_.Text(element, name));
    if (text == expected) return absl::OkStatus();
    return FieldError(fields_.PlaceOf(*element.Find(name)), name, Quoted(text), expected);
  }

  absl::StatusOr<Lens> ReadLens(const XmlElement& group) const {
    MW_RETURN_IF_ERROR(ExpectText(group, "CameraModelType", "Perspective"));
    MW_RETURN_IF_ERROR(ExpectText(group, "CameraOrientation", "XRightYDown"));
    MW_ASSIGN_OR_RETURN(const XmlElement* size, fields_.Child(group, "ImageDimensions"));
    Lens lens;
    MW_ASSIGN_OR_RETURN(const std::string width, fields_.Text(*size, "Width"));
    MW_ASSIGN_OR_RETURN(const std::string height, fields_.Text(*size, "Height"));
    MW_ASSIGN_OR_RETURN(lens.width, fields_.Side(*size, width, "Width"));
    MW_ASSIGN_OR_RETURN(lens.height, fields_.Side(*size, height, "Height"));
    if (group.Find("FocalLengthPixels") != nullptr) {
      MW_ASSIGN_OR_RETURN(lens.fx, fields_.Number(group, "FocalLengthPixels"));
    } else {
      MW_ASSIGN_OR_RETURN(const double focal_mm, fields_.Number(group, "FocalLength"));
      MW_ASSIGN_OR_RETURN(const double sensor_mm, fields_.Number(group, "SensorSize"));
      lens.fx = focal_mm / sensor_mm * std::max(lens.width, lens.height);
    }
    MW_ASSIGN_OR_RETURN(const double aspect, fields_.NumberOr(group, "AspectRatio", 1));
    lens.fy = lens.fx * aspect;
    MW_ASSIGN_OR_RETURN(lens.skew, fields_.NumberOr(group, "Skew", 0));
    lens.cx = lens.width / 2.0;
    lens.cy = lens.height / 2.0;
    if (const XmlElement* point = group.Find("PrincipalPoint"); point != nullptr) {
      MW_ASSIGN_OR_RETURN(lens.cx, fields_.Number(*point, "x"));
      MW_ASSIGN_OR_RETURN(lens.cy, fields_.Number(*point, "y"));
    }
    if (const XmlElement* distortion = group.Find("Distortion"); distortion != nullptr) {
      std::map<std::string, double> value;
      for (const char* name : {"K1", "K2", "K3", "P1", "P2"}) {
        MW_ASSIGN_OR_RETURN(value[name], fields_.NumberOr(*distortion, name, 0));
      }
      // Its P1 and P2 are OpenCV's p2 and p1.
      SetDistortion({.k1 = value["K1"], .k2 = value["K2"], .k3 = value["K3"], .p1 = value["P2"], .p2 = value["P1"]},
                    &lens);
    }
    MW_RETURN_IF_ERROR(CheckLens(lens, fields_.PlaceOf(group)));
    return lens;
  }

  absl::Status ReadGroup(const XmlElement& group) {
    const bool has_photographs = group.Find("Photo") != nullptr;
    if (!has_photographs) return absl::OkStatus();
    MW_ASSIGN_OR_RETURN(const Lens lens, ReadLens(group));
    for (const XmlElement& photo : group.children) {
      if (photo.name != "Photo") continue;
      const XmlElement* pose = photo.Find("Pose");
      if (pose == nullptr || pose->Find("Rotation") == nullptr || pose->Find("Center") == nullptr) {
        ++skipped_;
        continue;
      }
      MW_ASSIGN_OR_RETURN(const std::string id, fields_.Text(photo, "Id"));
      MW_ASSIGN_OR_RETURN(const std::string path, fields_.Text(photo, "ImagePath"));
      MW_ASSIGN_OR_RETURN(const Rigid3 cam_from_world, ReadPose(*pose));
      camera_of_photo_[id] = static_cast<CameraIndex>(scene_.views.size());
      scene_.views.push_back(
          {.view = {.name = PortableImageName(path), .image_path = "", .lens = lens, .cam_from_world = cam_from_world},
           .named_at = fields_.PlaceOf(photo)});
    }
    return absl::OkStatus();
  }

  absl::StatusOr<Rigid3> ReadPose(const XmlElement& pose) const {
    const XmlElement& rotation = *pose.Find("Rotation");
    Eigen::Matrix3d matrix;
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 3; ++column) {
        const std::string name = absl::StrCat("M_", row, column);
        MW_ASSIGN_OR_RETURN(matrix(row, column), fields_.Number(rotation, name.c_str()));
      }
    }
    MW_ASSIGN_OR_RETURN(const Eigen::Matrix3d cam_from_world, NearestRotation(matrix, fields_.PlaceOf(rotation)));
    MW_ASSIGN_OR_RETURN(const Eigen::Vector3d center_in_world, ReadVector(*pose.Find("Center")));
    return PoseFromCenter(cam_from_world, center_in_world);
  }

  absl::StatusOr<Eigen::Vector3d> ReadVector(const XmlElement& element) const {
    Eigen::Vector3d vector;
    constexpr std::array<const char*, 3> kNames = {"x", "y", "z"};
    for (int k = 0; k < 3; ++k) {
      MW_ASSIGN_OR_RETURN(vector[k], fields_.Number(element, kNames[static_cast<size_t>(k)]));
    }
    return vector;
  }

  absl::Status ReadPoint(const XmlElement& element) {
    SparsePoint point;
    MW_ASSIGN_OR_RETURN(const XmlElement* position, fields_.Child(element, "Position"));
    MW_ASSIGN_OR_RETURN(point.x_in_world, ReadVector(*position));
    if (const XmlElement* color = element.Find("Color"); color != nullptr) {
      constexpr std::array<const char*, 3> kNames = {"Red", "Green", "Blue"};
      for (size_t k = 0; k < 3; ++k) {
        MW_ASSIGN_OR_RETURN(const double share, fields_.NumberOr(*color, kNames[k], 0));
        point.rgb[k] = static_cast<uint8_t>(std::clamp(255 * share + 0.5, 0.0, 255.0));
      }
    }
    for (const XmlElement& measurement : element.children) {
      if (measurement.name != "Measurement") continue;
      MW_ASSIGN_OR_RETURN(const std::string id, fields_.Text(measurement, "PhotoId"));
      const auto camera = camera_of_photo_.find(id);
      if (camera != camera_of_photo_.end()) point.seen_by.push_back(camera->second);
    }
    scene_.points.push_back(std::move(point));
    return absl::OkStatus();
  }

  const XmlFields& fields_;
  ImportedScene& scene_;
  std::map<std::string, CameraIndex> camera_of_photo_;
  int skipped_ = 0;
};

}  // namespace

absl::StatusOr<Scene> ImportBlocksExchange(const std::string& file, const ImportOptions& options) {
  const XmlFields fields(file);
  MW_ASSIGN_OR_RETURN(const XmlElement root, fields.ReadRoot());
  MW_ASSIGN_OR_RETURN(const XmlElement* block, fields.Child(root, "Block"));
  const std::string folder = std::filesystem::path(file).parent_path().string();
  ImportedScene scene{
      .format = "blocks-exchange", .file = file, .image_folders = {JoinPath(folder, ""), JoinPath(folder, "images")}};
  MW_RETURN_IF_ERROR(BlockReader(fields, &scene).Read(*block));
  return AssembleScene(std::move(scene), options);
}

}  // namespace meshwright
