// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include <absl/status/statusor.h>
#include <nlohmann/json.hpp>

#include "coordinator/api/reconstruction_service.h"

namespace meshwright {

// ListCameras with what browsers want beside it: pose and lens of each camera, shares and times from the job's report.
absl::StatusOr<nlohmann::ordered_json> CamerasJson(const ReconstructionService& service, const std::string& id);

// What happened to a reconstruction, the oldest first, made from what is kept about it.
absl::StatusOr<nlohmann::ordered_json> LogJson(const ReconstructionService& service, const std::string& id);

}  // namespace meshwright
