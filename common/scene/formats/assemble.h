// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "common/scene/formats/import_options.h"
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
  // Where the width is 0: the lens at the size in px that the picture turns out to have. Without it the lens is as it
  // is but for the size.
  std::function<absl::StatusOr<Lens>(int width, int height)> lens_of_size = nullptr;
};

// What an importer has read.
struct ImportedScene {
  std::string format;  // its name
  std::string file;    // the one that lists the views
  std::vector<ImportedView> views;
  std::vector<SparsePoint> points;         // seen_by: indices into views, unsorted and with repetitions if need be
  std::vector<std::string> image_folders;  // where pictures may be, best first
  std::vector<std::string> warnings = {};
};

// Finds the pictures, checks them by their headers, sorts views and points. A picture is sought by its name in every
// folder, then by the last part of its name, then without regard to case; a name without an ending gets one. Cameras
// whose picture is missing are dropped as ImportScene says.
absl::StatusOr<Scene> AssembleScene(ImportedScene imported, const ImportOptions& options);

// The name of an image as other programs write paths: backslashes separate, and what is absolute or climbs out of the
// folder is cut to its last part.
std::string PortableImageName(const std::string& path);

// Which of several reconstructions in one file is taken, with `photographs` each: the largest, or options.model. Warns
// of the others. NotFound: there is no such model.
absl::StatusOr<size_t> ChooseLargest(const std::string& file, const std::vector<size_t>& photographs,
                                     const ImportOptions& options, std::vector<std::string>* warnings);

// ".jpg", also of "A.JPG".
std::string LowerCaseEnding(const std::string& name);
// The first bytes of a file, as many as there are up to `size`; empty when it cannot be read.
std::string ReadHead(const std::string& path, size_t size);
// The last part of a folder's full path, also for "." and "x/".
std::string NameOfFolder(const std::string& folder);
bool IsFile(const std::string& path);
bool IsFolder(const std::string& path);
std::string JoinPath(const std::string& folder, const std::string& name);
// Names of the files in a folder that end in `suffix`, sorted. Empty when there is no such folder.
std::vector<std::string> FilesEndingIn(const std::string& folder, const std::string& suffix);
// The path of the first of them; empty when there is none.
std::string FirstFileEndingIn(const std::string& folder, const std::string& suffix);

}  // namespace meshwright
