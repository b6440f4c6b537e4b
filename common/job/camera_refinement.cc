// SPDX-License-Identifier: Apache-2.0
#include "common/job/camera_refinement.h"

#include <cmath>
#include <utility>

#include <Eigen/LU>
#include <absl/strings/str_cat.h>
#include <nlohmann/json.hpp>

#include "common/base/status_macros.h"
#include "common/json/json_text.h"
#include "common/json/parse_json.h"
#include "common/json/whole_number.h"

namespace meshwright {
namespace {

using Json = nlohmann::ordered_json;

constexpr JsonLimits kLimits = {.max_bytes = size_t{256} << 20, .max_depth = 4};
constexpr size_t kNumbersOfPose = 12;    // rotation row by row, translation
constexpr double kRotationError = 1e-9;  // of R R^T

Json ToJson(const Rigid3& pose) {
  Json numbers = Json::array();
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) numbers.push_back(pose.rotation(row, column));
  }
  for (int row = 0; row < 3; ++row) numbers.push_back(pose.translation[row]);
  return numbers;
}

absl::StatusOr<Rigid3> PoseOf(const Json& json) {
  const auto numbers = json.get<std::vector<double>>();
  if (numbers.size() != kNumbersOfPose) return absl::DataLossError("a camera's pose has not 12 numbers");
  Rigid3 pose;
  for (int i = 0; i < 9; ++i) pose.rotation(i / 3, i % 3) = numbers[static_cast<size_t>(i)];
  for (int i = 0; i < 3; ++i) pose.translation[i] = numbers[static_cast<size_t>(9 + i)];
  const bool is_rotation =
      (pose.rotation * pose.rotation.transpose()).isApprox(Eigen::Matrix3d::Identity(), kRotationError) &&
      pose.rotation.determinant() > 0;
  if (!is_rotation || !pose.translation.allFinite()) return absl::DataLossError("a camera's pose is no rigid motion");
  return pose;
}

}  // namespace

std::string EncodeCameraRefinement(const CameraRefinement& refinement) {
  Json json = {{"tie_points", refinement.tie_points},
               {"error_px_before", refinement.error_px_before},
               {"error_px_after", refinement.error_px_after},
               {"off_px", refinement.off_px},
               {"reason", refinement.reason},
               {"cam_from_world", Json::array()}};
  for (const Rigid3& pose : refinement.cam_from_world) json["cam_from_world"].push_back(ToJson(pose));
  return JsonText(json);
}

absl::StatusOr<CameraRefinement> DecodeCameraRefinement(const std::string& text) {
  const absl::StatusOr<Json> json = ParseJson<Json>(text, kLimits);
  if (!json.ok()) return absl::DataLossError(absl::StrCat("refined cameras: ", json.status().message()));
  CameraRefinement refinement;
  try {
    const absl::StatusOr<int64_t> tie_points = WholeNumber<int64_t>(json->at("tie_points"));
    if (!tie_points.ok()) return absl::DataLossError(absl::StrCat("refined cameras: ", tie_points.status().message()));
    refinement.tie_points = *tie_points;
    refinement.error_px_before = json->at("error_px_before").get<double>();
    refinement.error_px_after = json->at("error_px_after").get<double>();
    refinement.off_px = json->at("off_px").get<double>();
    refinement.reason = json->at("reason").get<std::string>();
    for (const Json& pose : json->at("cam_from_world").get_ref<const Json::array_t&>()) {
      MW_ASSIGN_OR_RETURN(refinement.cam_from_world.emplace_back(), PoseOf(pose));
    }
  } catch (const Json::exception& error) {
    return absl::DataLossError(absl::StrCat("not refined cameras: ", error.what()));
  }
  return refinement;
}

absl::Status ApplyRefinement(const CameraRefinement& refinement, Scene& scene) {
  if (!refinement.moved()) return absl::OkStatus();
  if (refinement.cam_from_world.size() != scene.views.size()) {
    return absl::FailedPreconditionError(absl::StrCat("refined cameras of ", refinement.cam_from_world.size(),
                                                      " photographs, expected ", scene.views.size()));
  }
  for (size_t i = 0; i < scene.views.size(); ++i) scene.views[i].cam_from_world = refinement.cam_from_world[i];
  return absl::OkStatus();
}

}  // namespace meshwright
