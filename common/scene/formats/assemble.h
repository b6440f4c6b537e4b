#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "common/scene/formats/text_fields.h"
#include "common/scene/scene.h"

// What all importers share: the checks that do not depend on the format, and the last step to a Scene.
namespace meshwright {

// Sizes positive and below the decoder's limit, focal lengths positive, everything finite and of a credible size.
absl::Status CheckLens(const Lens& lens, const Place& place);

// The rotation nearest to `matrix`, which files give with few digits; an error when it is far from any.
absl::StatusOr<Eigen::Matrix3d> NearestRotation(const Eigen::Matrix3d& matrix, const Place& place);
// Hamilton quaternion, of about unit length.
absl::StatusOr<Eigen::Matrix3d> RotationFromQuaternion(double w, double x, double y, double z, const Place& place);

struct ImportedView {
  SceneView view;  // image_path is empty yet; the lens is checked, or its width is 0: the file does not tell the size
  Place named_at;
};

// Sorts views and points, finds the pictures and checks them by their headers. `points[i].seen_by` refer to the order
// of `views`, unsorted and with repetitions if need be. Pictures are in the first of `image_folders` that holds the
// first view's. `file` is the one that lists the views.
absl::StatusOr<Scene> AssembleScene(const std::string& format, const std::string& file, std::vector<ImportedView> views,
                                    std::vector<SparsePoint> points, const std::vector<std::string>& image_folders);

bool IsFile(const std::string& path);
bool IsFolder(const std::string& path);
std::string JoinPath(const std::string& folder, const std::string& name);
// Names of the files in a folder that end in `suffix`, sorted. Empty when there is no such folder.
std::vector<std::string> FilesEndingIn(const std::string& folder, const std::string& suffix);

}  // namespace meshwright
