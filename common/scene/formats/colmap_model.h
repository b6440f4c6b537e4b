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
  // `model_folder`: where the files are; pictures are in images/ there or in a folder above, or beside the files.
  absl::StatusOr<Scene> Finish(const std::string& format, const std::string& model_folder,
                               const std::string& images_file);

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

// The folder of a COLMAP model: `folder` itself, or model/, sparse/ or sparse/0/ in it, whichever first has cameras and
// images files with this extension ("txt", "bin"). Empty when there is none.
std::string FindColmapModelFolder(const std::string& folder, const std::string& extension);
// What FindColmapModelFolder looks for, for errors.
std::string ColmapModelFiles(const std::string& extension);

}  // namespace meshwright
