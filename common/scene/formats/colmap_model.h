// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "common/scene/formats/assemble.h"
#include "common/scene/scene.h"

// What COLMAP's text and binary models share.
namespace meshwright {

struct ColmapModelType {
  int id;
  const char* name;
  Lens::Model model;
  int parameters;     // in the file
  bool single_focal;  // f instead of fx fy
};

// Null when the id or name is none of those known.
const ColmapModelType* FindColmapModelType(int id);
const ColmapModelType* FindColmapModelType(std::string_view name);
// For errors: the names that are known.
std::string KnownColmapModelTypes();

// Collects a model's cameras, images and points, in this order, and checks each against those before it.
class ColmapSceneBuilder {
 public:
  absl::Status AddCamera(const Place& place, uint32_t camera_id, const ColmapModelType& type, int64_t width,
                         int64_t height, const std::vector<double>& parameters);
  // `quaternion`: w x y z. `observations`: length of the image's list of 2D points, which tracks refer to.
  absl::Status AddImage(const Place& place, uint32_t image_id, const std::array<double, 4>& quaternion,
                        const Eigen::Vector3d& translation, uint32_t camera_id, const std::string& name,
                        int64_t observations);
  // `track`: pairs of image id and index into the image's list.
  absl::Status AddPoint(const Place& place, const Eigen::Vector3d& x_in_world, const std::array<uint8_t, 3>& rgb,
                        const std::vector<std::pair<uint32_t, uint32_t>>& track);
  // `scene`: all but views and points.
  absl::StatusOr<Scene> Finish(ImportedScene scene, const ImportOptions& options);

 private:
  struct ImageRecord {
    CameraIndex view;
    int64_t observations;
  };
  std::unordered_map<uint32_t, Lens> lenses_;  // looked up, never iterated over: the order must not matter
  std::unordered_map<uint32_t, ImageRecord> images_;
  std::vector<ImportedView> views_;
  std::vector<SparsePoint> points_;
};

// The folder of one COLMAP model or of several: `folder` itself, or model/, sparse/ or colmap/sparse/ in it, whichever
// first has cameras and images files with this extension ("txt", "bin"), or folders 0/, 1/ ... that have. Empty when
// there is none.
std::string FindColmapModels(const std::string& folder, const std::string& extension);
// What FindColmapModels looks for, for errors.
std::string ColmapModelFiles(const std::string& extension);
// The model in a folder that FindColmapModels gave: of several (0/, 1/ ..., reconstructions that have nothing to do
// with each other) options.model, else the one with most images, the first of equals. `warnings` name the others.
absl::StatusOr<std::string> ChooseColmapModel(const std::string& folder, const std::string& extension,
                                              const ImportOptions& options, std::vector<std::string>* warnings);
// Where a model's pictures may be: in images/ beside its files or beside them; and where the model's folder has one of
// the names above, the same in the folder that holds it. Never further up: pictures there are another scene's.
std::vector<std::string> ColmapImageFolders(const std::string& model_folder);

}  // namespace meshwright
