// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include <absl/status/statusor.h>
#include <nlohmann/json.hpp>

#include "common/base/thread_pool.h"
#include "common/scene/scene.h"

namespace meshwright {

// What a page is made of.
struct ReportPageInput {
  std::string title;
  // As report.json has it; what is missing is left out of the page.
  const nlohmann::ordered_json& report;
  const Scene& scene;    // image_path of each view is a file
  std::string ply_path;  // the whole mesh
};

// One HTML page that needs nothing beside itself, neither files nor a network: each photograph with the part of it in
// which the mesh is seen, where rays were lost, times, options, and the mesh as two of the photographs' cameras see it.
// At most kMostPhotographs of them are shown, those that see least of the mesh. A photograph that cannot be read any
// more has no picture. Errors are those of the mesh.
constexpr size_t kMostPhotographs = 600;
absl::StatusOr<std::string> MakeReportPage(const ReportPageInput& input, ThreadPool& pool);

}  // namespace meshwright
