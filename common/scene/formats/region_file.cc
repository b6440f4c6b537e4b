// SPDX-License-Identifier: Apache-2.0
#include "common/scene/formats/region_file.h"

#include <algorithm>
#include <vector>

#include <absl/strings/str_cat.h>

#include "common/base/status_macros.h"
#include "common/scene/formats/assemble.h"
#include "common/scene/formats/json_node.h"

namespace meshwright {
namespace {

absl::StatusOr<OrientedBox> Checked(const OrientedBox& box, const Place& place) {
  if ((box.size.array() > 0).all()) return box;
  return FieldError(place, "size", absl::StrCat(box.size.x(), ", ", box.size.y(), ", ", box.size.z()),
                    "three lengths more than 0");
}

}  // namespace

absl::StatusOr<OrientedBox> ReadRegion(const std::string& file) {
  MW_ASSIGN_OR_RETURN(const JsonNode root, JsonNode::ReadFile(file));
  OrientedBox box;
  if (root.IsArray()) {
    MW_ASSIGN_OR_RETURN(const std::vector<double> bounds, root.Numbers(6));
    const Eigen::Map<const Eigen::Vector3d> low(bounds.data());
    const Eigen::Map<const Eigen::Vector3d> high(bounds.data() + 3);
    box.center = 0.5 * (low + high);
    box.size = high - low;
    return Checked(box, root.place());
  }
  MW_ASSIGN_OR_RETURN(const JsonNode center, root.At("center"));
  MW_ASSIGN_OR_RETURN(box.center, center.Vector3());
  MW_ASSIGN_OR_RETURN(const JsonNode size, root.At("size"));
  MW_ASSIGN_OR_RETURN(box.size, size.Vector3());
  if (root.Has("axes")) {
    MW_ASSIGN_OR_RETURN(const JsonNode axes, root.At("axes"));
    MW_ASSIGN_OR_RETURN(const Eigen::Matrix3d rows, axes.Matrix3());
    MW_ASSIGN_OR_RETURN(box.axes, NearestRotation(rows, axes.place()));
  }
  return Checked(box, root.place());
}

absl::StatusOr<OrientedBox> RegionOfPoints(const Scene& scene) {
  constexpr size_t kFewest = 20;
  constexpr double kOutlierShare = 0.01;
  constexpr double kGrowth = 1.1;
  if (scene.points.size() < kFewest) {
    return absl::FailedPreconditionError(absl::StrCat("region is auto, and the scene has ", scene.points.size(),
                                                      " sparse points; expected at least ", kFewest));
  }
  OrientedBox box;
  for (int k = 0; k < 3; ++k) {
    std::vector<double> values;
    for (const SparsePoint& point : scene.points) values.push_back(point.x_in_world[k]);
    std::sort(values.begin(), values.end());
    const auto outliers = static_cast<size_t>(kOutlierShare * static_cast<double>(values.size()));
    const double low = values[outliers];
    const double high = values[values.size() - 1 - outliers];
    box.center[k] = 0.5 * (low + high);
    box.size[k] = kGrowth * (high - low);
  }
  // A flat scene has a box all the same.
  box.size = box.size.cwiseMax(0.1 * box.size.maxCoeff());
  if (!(box.size.maxCoeff() > 0)) return absl::FailedPreconditionError("region is auto, and all sparse points are one");
  return box;
}

absl::Status SetRegion(const std::string& region, const std::string& folder, Scene* scene) {
  if (region == "none") return absl::OkStatus();
  if (region == "auto") {
    MW_ASSIGN_OR_RETURN(scene->region, RegionOfPoints(*scene));
    return absl::OkStatus();
  }
  const std::string file = region.empty() ? JoinPath(folder, "region.json") : region;
  if (region.empty() && !IsFile(file)) return absl::OkStatus();
  MW_ASSIGN_OR_RETURN(scene->region, ReadRegion(file));
  scene->region->center -= scene->offset;
  if (region.empty()) {
    scene->warnings.push_back(absl::StrCat("only what is in ", file, " is reconstructed; --region none for all of it"));
  }
  return absl::OkStatus();
}

}  // namespace meshwright
