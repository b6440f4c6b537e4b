// SPDX-License-Identifier: Apache-2.0
#include "common/scene/formats/opensfm.h"

#include <algorithm>
#include <map>
#include <utility>
#include <vector>

#include <Eigen/Geometry>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_split.h>

#include "common/base/status_macros.h"
#include "common/scene/formats/assemble.h"
#include "common/scene/formats/json_node.h"
#include "common/scene/formats/lens_and_pose.h"

namespace meshwright {
namespace {

constexpr char kFile[] = "reconstruction.json";

// All lengths are divided by the longer side, and the origin is the image's centre.
absl::StatusOr<Lens> ReadLens(const JsonNode& camera) {
  Lens lens;
  MW_ASSIGN_OR_RETURN(lens.width, camera.Side("width"));
  MW_ASSIGN_OR_RETURN(lens.height, camera.Side("height"));
  const double size = std::max(lens.width, lens.height);
  MW_ASSIGN_OR_RETURN(const std::string type, camera.Text("projection_type"));
  const bool one_focal = camera.Has("focal");
  MW_ASSIGN_OR_RETURN(const double fx, camera.Number(one_focal ? "focal" : "focal_x"));
  MW_ASSIGN_OR_RETURN(const double fy, camera.Number(one_focal ? "focal" : "focal_y"));
  MW_ASSIGN_OR_RETURN(const double cx, camera.NumberOr("c_x", 0));
  MW_ASSIGN_OR_RETURN(const double cy, camera.NumberOr("c_y", 0));
  lens.fx = fx * size;
  lens.fy = fy * size;
  lens.cx = cx * size + lens.width / 2.0;
  lens.cy = cy * size + lens.height / 2.0;

  std::map<std::string, double> c;
  for (const char* name : {"k1", "k2", "k3", "k4", "p1", "p2"}) {
    MW_ASSIGN_OR_RETURN(c[name], camera.NumberOr(name, 0));
  }
  if (type == "perspective" || type == "brown" || type == "simple_radial" || type == "radial") {
    SetDistortion({.k1 = c["k1"], .k2 = c["k2"], .k3 = c["k3"], .p1 = c["p1"], .p2 = c["p2"]}, &lens);
  } else if (type == "fisheye" || type == "fisheye_opencv") {
    lens.model = Lens::Model::kOpenCvFisheye;
    lens.coefficients = {c["k1"], c["k2"], c["k3"], c["k4"]};
  } else {
    MW_ASSIGN_OR_RETURN(const JsonNode node, camera.At("projection_type"));
    return node.Error(
        "perspective, brown, simple_radial, radial, fisheye or fisheye_opencv (panoramas have to be cut into pinhole "
        "views)");
  }
  MW_RETURN_IF_ERROR(CheckLens(lens, camera.place()));
  return lens;
}

absl::StatusOr<std::vector<ImportedView>> ReadShots(const JsonNode& reconstruction) {
  std::map<std::string, Lens> lenses;
  MW_ASSIGN_OR_RETURN(const JsonNode cameras, reconstruction.At("cameras"));
  MW_ASSIGN_OR_RETURN(const auto camera_members, cameras.Members());
  for (const auto& [id, camera] : camera_members) {
    MW_ASSIGN_OR_RETURN(lenses[id], ReadLens(camera));
  }
  MW_ASSIGN_OR_RETURN(const JsonNode shots, reconstruction.At("shots"));
  MW_ASSIGN_OR_RETURN(const auto shot_members, shots.Members());
  std::vector<ImportedView> views;
  for (const auto& [name, shot] : shot_members) {
    ImportedView imported{.view = {}, .named_at = shot.place()};
    imported.view.name = PortableImageName(name);
    MW_ASSIGN_OR_RETURN(const std::string camera, shot.Text("camera"));
    const auto lens = lenses.find(camera);
    if (lens == lenses.end()) {
      MW_ASSIGN_OR_RETURN(const JsonNode node, shot.At("camera"));
      return node.Error("one of the names in cameras");
    }
    imported.view.lens = lens->second;
    MW_ASSIGN_OR_RETURN(const JsonNode rotation_node, shot.At("rotation"));
    MW_ASSIGN_OR_RETURN(const Eigen::Vector3d rotation, rotation_node.Vector3());
    MW_ASSIGN_OR_RETURN(const JsonNode translation_node, shot.At("translation"));
    MW_ASSIGN_OR_RETURN(imported.view.cam_from_world.translation, translation_node.Vector3());
    const double angle = rotation.norm();
    if (angle > 0) {
      imported.view.cam_from_world.rotation = Eigen::AngleAxisd(angle, rotation / angle).toRotationMatrix();
    }
    views.push_back(std::move(imported));
  }
  return views;
}

// tracks.csv says which photographs show a point: image, track, feature, x y scale r g b, between tabs.
absl::Status ReadTracks(const std::string& file, const std::vector<ImportedView>& views,
                        const std::map<std::string, size_t>& point_of_track, std::vector<SparsePoint>* points) {
  std::map<std::string, CameraIndex, std::less<>> camera_of_name;
  for (size_t i = 0; i < views.size(); ++i) camera_of_name[views[i].view.name] = static_cast<CameraIndex>(i);
  MW_ASSIGN_OR_RETURN(const std::string text, ReadTextFile(file));
  TextLines lines(text);
  std::string_view line;
  while (lines.NextContent(&line)) {
    if (lines.number() == 1 && line.substr(0, 22) == "OPENSFM_TRACKS_VERSION") continue;
    const std::vector<std::string> fields = absl::StrSplit(std::string(line), '\t');
    if (fields.size() < 5) {
      return FieldError({.file = file, .number = lines.number()}, "the line", Quoted(line),
                        "image, track, feature, x, y between tabs");
    }
    const auto camera = camera_of_name.find(PortableImageName(fields[0]));
    const auto point = point_of_track.find(fields[1]);
    // Tracks of photographs without a pose, and those that were given up, are there too.
    if (camera == camera_of_name.end() || point == point_of_track.end()) continue;
    (*points)[point->second].seen_by.push_back(camera->second);
  }
  return absl::OkStatus();
}

absl::StatusOr<std::vector<SparsePoint>> ReadPoints(const JsonNode& reconstruction, const std::string& tracks_file,
                                                    const std::vector<ImportedView>& views) {
  std::vector<SparsePoint> points;
  if (!reconstruction.Has("points") || !IsFile(tracks_file)) return points;
  MW_ASSIGN_OR_RETURN(const JsonNode node, reconstruction.At("points"));
  MW_ASSIGN_OR_RETURN(const auto members, node.Members());
  std::map<std::string, size_t> point_of_track;
  for (const auto& [track, value] : members) {
    SparsePoint point;
    MW_ASSIGN_OR_RETURN(const JsonNode coordinates, value.At("coordinates"));
    MW_ASSIGN_OR_RETURN(point.x_in_world, coordinates.Vector3());
    if (value.Has("color")) {
      MW_ASSIGN_OR_RETURN(const JsonNode color_node, value.At("color"));
      MW_ASSIGN_OR_RETURN(point.rgb, color_node.Color());
    }
    point_of_track[track] = points.size();
    points.push_back(std::move(point));
  }
  MW_RETURN_IF_ERROR(ReadTracks(tracks_file, views, point_of_track, &points));
  return points;
}

// Several reconstructions have nothing to do with each other: the largest, or the one asked for.
absl::StatusOr<JsonNode> ChooseReconstruction(const JsonNode& root, const ImportOptions& options,
                                              std::vector<std::string>* warnings) {
  MW_ASSIGN_OR_RETURN(const std::vector<JsonNode> all, root.Elements());
  if (all.empty()) return root.Error("a reconstruction at least");
  std::vector<size_t> shots;
  for (const JsonNode& reconstruction : all) {
    MW_ASSIGN_OR_RETURN(const JsonNode node, reconstruction.At("shots"));
    shots.push_back(node.size());
  }
  MW_ASSIGN_OR_RETURN(const size_t chosen, ChooseLargest(root.place().file, shots, options, warnings));
  return all[chosen];
}

}  // namespace

std::string FindOpenSfm(const std::string& folder) {
  for (const char* below : {"", "opensfm"}) {
    std::string candidate = JoinPath(folder, below);
    if (IsFile(JoinPath(candidate, kFile))) return candidate;
  }
  return "";
}

absl::StatusOr<Scene> ImportOpenSfm(const std::string& folder, const ImportOptions& options) {
  const std::string file = JoinPath(folder, kFile);
  MW_ASSIGN_OR_RETURN(const JsonNode root, JsonNode::ReadFile(file));
  ImportedScene scene{.format = "opensfm", .file = file};
  MW_ASSIGN_OR_RETURN(const JsonNode reconstruction, ChooseReconstruction(root, options, &scene.warnings));
  MW_ASSIGN_OR_RETURN(scene.views, ReadShots(reconstruction));
  const std::string tracks_file = JoinPath(folder, "tracks.csv");
  MW_ASSIGN_OR_RETURN(scene.points, ReadPoints(reconstruction, tracks_file, scene.views));
  if (scene.points.empty()) {
    scene.warnings.push_back(absl::StrCat("no sparse points: ", tracks_file,
                                          " would say which photographs show them; results are better with"));
  }
  scene.image_folders = {JoinPath(folder, "images"), folder};
  if (NameOfFolder(folder) == "opensfm") scene.image_folders.push_back(JoinPath(folder, "../images"));
  return AssembleScene(std::move(scene), options);
}

}  // namespace meshwright
