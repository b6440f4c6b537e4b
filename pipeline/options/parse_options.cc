#include "pipeline/options/parse_options.h"

#include <limits>
#include <set>
#include <type_traits>
#include <vector>

#include <absl/strings/str_cat.h>
#include <nlohmann/json.hpp>

#include "common/base/status_macros.h"

namespace meshwright {
namespace {

using Json = nlohmann::ordered_json;

constexpr char kVersion[] = "version";

absl::Status WrongType(const char* name, const Json& value, const char* expected) {
  return absl::InvalidArgumentError(
      absl::StrCat("options_json: ", name, " is ", value.dump().substr(0, 40), ", expected ", expected));
}

template <typename Field>
absl::Status Assign(const char* name, const Json& value, Field& field) {
  if constexpr (std::is_same_v<Field, bool>) {
    if (!value.is_boolean()) return WrongType(name, value, "true or false");
    field = value.get<bool>();
  } else if constexpr (std::is_integral_v<Field>) {
    if (!value.is_number_integer()) return WrongType(name, value, "a whole number");
    const auto number = value.get<int64_t>();
    const bool fits = number >= std::numeric_limits<Field>::lowest() && number <= std::numeric_limits<Field>::max();
    if (!fits || (value.is_number_unsigned() && number < 0)) return WrongType(name, value, "a smaller number");
    field = static_cast<Field>(number);
  } else {
    if (!value.is_number()) return WrongType(name, value, "a number");
    field = value.get<Field>();
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<ReconstructionOptions> ParseOptions(const std::string& options_json) {
  const Json json = Json::parse(options_json.empty() ? "{}" : options_json, nullptr, false);
  if (!json.is_object()) return absl::InvalidArgumentError("options_json: a JSON object expected");
  ReconstructionOptions options;
  std::set<std::string> known = {kVersion};
  absl::Status status;
  VisitOptions(options, [&](const char*, const char* name, auto& field, const char*) {
    known.insert(name);
    const auto found = json.find(name);
    if (found != json.end()) status.Update(Assign(name, *found, field));
  });
  MW_RETURN_IF_ERROR(status);
  for (const auto& [name, value] : json.items()) {
    if (known.count(name) == 0) {
      return absl::InvalidArgumentError(absl::StrCat("options_json: there is no option \"", name.substr(0, 64), "\""));
    }
  }
  const auto version = json.find(kVersion);
  if (version != json.end() && *version != MW_VERSION) {
    return absl::InvalidArgumentError(
        absl::StrCat("options_json: version is ", version->dump().substr(0, 40), ", this is ", MW_VERSION));
  }
  if (const absl::Status valid = options.Validate(); !valid.ok()) {
    return absl::InvalidArgumentError(absl::StrCat("options_json: ", std::string(valid.message())));
  }
  return options;
}

}  // namespace meshwright
