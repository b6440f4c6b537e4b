// SPDX-License-Identifier: Apache-2.0
#include "common/scene/formats/metashape.h"

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

// One frame of coordinates: a component of a chunk.
using Component = std::vector<ImportedView>;

class ChunkReader {
 public:
  ChunkReader(const XmlFields& fields, const XmlElement& chunk) : fields_(fields), chunk_(chunk) {}

  absl::Status Read() {
    MW_ASSIGN_OR_RETURN(const XmlElement* sensors, fields_.Child(chunk_, "sensors"));
    for (const XmlElement& sensor : sensors->children) {
      if (sensor.name == "sensor") MW_RETURN_IF_ERROR(ReadSensor(sensor));
    }
    MW_ASSIGN_OR_RETURN(const XmlElement* cameras, fields_.Child(chunk_, "cameras"));
    return ReadCameras(*cameras);
  }

  std::vector<Component> TakeComponents() {
    std::vector<Component> components;
    for (auto& [id, views] : views_) components.push_back(std::move(views));
    return components;
  }
  int skipped() const { return skipped_; }

 private:
  // Sensors without calibration have no lens; their cameras are skipped.
  absl::Status ReadSensor(const XmlElement& sensor) {
    const XmlElement* calibration = nullptr;
    for (const XmlElement& child : sensor.children) {
      if (child.name != "calibration") continue;
      const std::string* kind = child.Attribute("class");
      if (calibration == nullptr || (kind != nullptr && *kind == "adjusted")) calibration = &child;
    }
    if (calibration == nullptr) return absl::OkStatus();
    MW_ASSIGN_OR_RETURN(const std::string id, fields_.Attribute(sensor, "id"));
    const std::string* type = calibration->Attribute("type");
    if (type == nullptr) type = sensor.Attribute("type");
    const bool is_fisheye = type != nullptr && *type == "fisheye";
    if (type != nullptr && *type != "frame" && !is_fisheye) {
      return FieldError(fields_.PlaceOf(sensor), "type of sensor", Quoted(*type),
                        "frame or fisheye (panoramas have to be cut into pinhole views)");
    }
    const XmlElement* resolution = calibration->Find("resolution");
    if (resolution == nullptr) {
      MW_ASSIGN_OR_RETURN(resolution, fields_.Child(sensor, "resolution"));
    }
    Lens lens;
    MW_ASSIGN_OR_RETURN(const std::string width, fields_.Attribute(*resolution, "width"));
    MW_ASSIGN_OR_RETURN(const std::string height, fields_.Attribute(*resolution, "height"));
    MW_ASSIGN_OR_RETURN(lens.width, fields_.Side(*resolution, width, "width"));
    MW_ASSIGN_OR_RETURN(lens.height, fields_.Side(*resolution, height, "height"));
    MW_RETURN_IF_ERROR(ReadCalibration(*calibration, is_fisheye, &lens));
    lenses_[id] = lens;
    return absl::OkStatus();
  }

  absl::Status ReadCalibration(const XmlElement& calibration, bool is_fisheye, Lens* lens) const {
    std::map<std::string, double> value;
    for (const char* name : {"cx", "cy", "k1", "k2", "k3", "k4", "p1", "p2", "b1", "b2"}) {
      MW_ASSIGN_OR_RETURN(value[name], fields_.NumberOr(calibration, name, 0));
    }
    MW_ASSIGN_OR_RETURN(const double f, fields_.Number(calibration, "f"));
    lens->fx = f + value["b1"];
    lens->fy = f;
    lens->skew = value["b2"];
    lens->cx = lens->width / 2.0 + value["cx"];
    lens->cy = lens->height / 2.0 + value["cy"];
    // Its p1 and p2 are OpenCV's p2 and p1.
    const RadialTangential distortion = {.k1 = value["k1"],
                                         .k2 = value["k2"],
                                         .k3 = value["k3"],
                                         .k4 = value["k4"],
                                         .p1 = value["p2"],
                                         .p2 = value["p1"]};
    if (is_fisheye) {
      lens->model = Lens::Model::kThinPrismFisheye;
      lens->coefficients = {distortion.k1, distortion.k2, distortion.p1, distortion.p2, distortion.k3, distortion.k4};
    } else {
      SetDistortion(distortion, lens);
    }
    return CheckLens(*lens, fields_.PlaceOf(calibration));
  }

  absl::Status ReadCameras(const XmlElement& holder) {
    for (const XmlElement& child : holder.children) {
      if (child.name == "group") MW_RETURN_IF_ERROR(ReadCameras(child));  // not deeper than the file's limit
      if (child.name == "camera") MW_RETURN_IF_ERROR(ReadCamera(child));
    }
    return absl::OkStatus();
  }

  absl::Status ReadCamera(const XmlElement& camera) {
    const std::string* enabled = camera.Attribute("enabled");
    const XmlElement* transform = camera.Find("transform");
    MW_ASSIGN_OR_RETURN(const std::string sensor, fields_.Attribute(camera, "sensor_id"));
    const auto lens = lenses_.find(sensor);
    const bool is_disabled = enabled != nullptr && (*enabled == "false" || *enabled == "0");
    if (is_disabled || transform == nullptr || lens == lenses_.end()) {
      ++skipped_;
      return absl::OkStatus();
    }
    const Place place = fields_.PlaceOf(*transform);
    MW_ASSIGN_OR_RETURN(const std::vector<double> numbers, fields_.Numbers(*transform, 16));
    const Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>> chunk_from_cam(numbers.data());
    if (chunk_from_cam.row(3) != Eigen::RowVector4d(0, 0, 0, 1)) {
      return FieldError(place, "last row of transform", absl::StrCat(numbers[12], " ", numbers[15]), "0 0 0 1");
    }
    MW_ASSIGN_OR_RETURN(const Eigen::Matrix3d rotation, NearestRotation(chunk_from_cam.topLeftCorner<3, 3>(), place));
    MW_ASSIGN_OR_RETURN(const std::string label, fields_.Attribute(camera, "label"));
    const std::string* component = camera.Attribute("component_id");
    views_[component == nullptr ? "0" : *component].push_back(
        {.view = {.name = PortableImageName(label),
                  .image_path = "",
                  .lens = lens->second,
                  .cam_from_world = PoseFromCenter(rotation.transpose(), chunk_from_cam.topRightCorner<3, 1>())},
         .named_at = fields_.PlaceOf(camera)});
    return absl::OkStatus();
  }

  const XmlFields& fields_;
  const XmlElement& chunk_;
  std::map<std::string, Lens> lenses_;
  std::map<std::string, std::vector<ImportedView>> views_;  // by component
  int skipped_ = 0;
};

}  // namespace

absl::StatusOr<Scene> ImportMetashape(const std::string& file, const ImportOptions& options) {
  const XmlFields fields(file);
  MW_ASSIGN_OR_RETURN(const XmlElement root, fields.ReadRoot());
  const std::string folder = std::filesystem::path(file).parent_path().string();
  ImportedScene scene{
      .format = "metashape", .file = file, .image_folders = {JoinPath(folder, ""), JoinPath(folder, "images")}};
  std::vector<Component> components;
  std::vector<size_t> sizes;
  int chunks = 0;
  int skipped = 0;
  for (const XmlElement& chunk : root.children) {
    if (chunk.name != "chunk") continue;
    ++chunks;
    ChunkReader reader(fields, chunk);
    MW_RETURN_IF_ERROR(reader.Read());
    skipped += reader.skipped();
    for (Component& component : reader.TakeComponents()) {
      sizes.push_back(component.size());
      components.push_back(std::move(component));
    }
  }
  if (components.empty()) {
    return absl::InvalidArgumentError(
        absl::StrCat(file, ": no aligned camera in ", chunks, " chunks; expected cameras with a transform"));
  }
  MW_ASSIGN_OR_RETURN(const size_t chosen, ChooseLargest(file, sizes, options, &scene.warnings));
  scene.views = std::move(components[chosen]);
  if (skipped > 0) {
    scene.warnings.push_back(absl::StrCat(skipped, " cameras are not aligned, disabled or without calibration"));
  }
  scene.warnings.push_back("no sparse points, which Metashape's XML does not have; results are better with");
  return AssembleScene(std::move(scene), options);
}

}  // namespace meshwright
