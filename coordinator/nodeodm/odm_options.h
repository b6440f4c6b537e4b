// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include <absl/status/statusor.h>
#include <nlohmann/json.hpp>

namespace meshwright {

// What a task's options mean here.
struct OdmTaskOptions {
  nlohmann::ordered_json given = nlohmann::ordered_json::array();  // [{"name", "value"}], as they came
  nlohmann::json own = nlohmann::json::object();                   // of ours: name -> number
  double image_scale = 1;           // of the photographs' size, by pc-quality and feature-quality
  bool skips_model = false;         // no textured model
  std::vector<std::string> unused;  // names that have no meaning here
};

// The options of NodeODM's protocol: our own, and those of ODM that mean something here. Immutable.
class OdmOptions {
 public:
  // `own_options`: the answer of GET /v1/options.
  explicit OdmOptions(const std::string& own_options);

  // The answer of GET /options: objects with exactly name, type, value, domain and help.
  const std::string& description() const { return description_; }

  // `json`: a JSON array of {"name", "value"}, "" stands for none. Unknown options are taken and named in `unused`.
  // InvalidArgument: not such an array, or, as a JSON array of {"name", "error"}, all values that are refused.
  absl::StatusOr<OdmTaskOptions> Parse(const std::string& json) const;

 private:
  nlohmann::json own_;  // array of descriptions
  std::string description_;
};

// The options of a reconstruction of photographs whose longest side is `longest_side_px`.
std::string OwnOptionsJson(const OdmTaskOptions& options, int longest_side_px);

}  // namespace meshwright
