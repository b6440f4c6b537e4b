#include "pipeline/options/reconstruction_options.h"

#include <absl/strings/str_cat.h>

#include "common/base/status_macros.h"

namespace meshwright {

absl::Status ReconstructionOptions::Validate() const {
  if (max_image_size < 0) {
    return absl::InvalidArgumentError(absl::StrCat("max-image-size is ", max_image_size, " px, expected >= 0"));
  }
  if (conductor.targets.max_targets > kMaxTargets) {
    return absl::InvalidArgumentError(
        absl::StrCat("max-targets is ", conductor.targets.max_targets, ", expected 1..", kMaxTargets));
  }
  MW_RETURN_IF_ERROR(job.Validate());
  MW_RETURN_IF_ERROR(join.Validate());
  return conductor.Validate();
}

std::vector<OptionDescription> DescribeOptions() {
  std::vector<OptionDescription> descriptions;
  const ReconstructionOptions defaults;
  VisitOptions(defaults, [&](const char* group, const char* name, const auto& field, const char* help) {
    descriptions.push_back({group, name, field, help});
  });
  return descriptions;
}

nlohmann::ordered_json ToJson(const ReconstructionOptions& options) {
  nlohmann::ordered_json json;
  json["version"] = MW_VERSION;
  VisitOptions(options, [&](const char*, const char* name, const auto& field, const char*) { json[name] = field; });
  return json;
}

std::vector<std::string> DescribeDifferences(const nlohmann::ordered_json& before, const nlohmann::ordered_json& now) {
  std::vector<std::string> differences;
  for (const auto& [name, value] : now.items()) {
    const auto stored = before.find(name);
    if (stored != before.end() && *stored == value) continue;
    differences.push_back(absl::StrCat("--", name, " was ", stored == before.end() ? "not known" : stored->dump(),
                                       ", now ", value.dump()));
  }
  return differences;
}

}  // namespace meshwright
