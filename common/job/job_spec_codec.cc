// SPDX-License-Identifier: Apache-2.0
#include "common/job/job_spec_codec.h"

#include <absl/strings/str_cat.h>
#include <nlohmann/json.hpp>

#include "common/base/status_macros.h"
#include "common/json/json_text.h"
#include "common/json/parse_json.h"
#include "common/json/whole_number.h"

namespace meshwright {

using Json = nlohmann::ordered_json;

namespace {

// A job may look at many surfaces that were accepted before.
constexpr JsonLimits kLimits = {.max_bytes = size_t{256} << 20, .max_depth = 3};

template <typename T>
absl::StatusOr<T> NumberOf(const Json& json) {
  absl::StatusOr<T> number = WholeNumber<T>(json);
  if (number.ok()) return number;
  return absl::DataLossError(absl::StrCat("not a camera job's specification: ", number.status().message()));
}

}  // namespace

std::string EncodeJobSpec(const StoredJobSpec& spec) {
  Json json = {{"targets", spec.targets}, {"accepted", Json::array()}, {"memory_bytes", spec.memory_bytes}};
  for (const AcceptedSurface& surface : spec.accepted) {
    json["accepted"].push_back({surface.sequence, surface.camera, surface.digest, surface.patches});
  }
  return JsonText(json);
}

absl::StatusOr<StoredJobSpec> DecodeJobSpec(const std::string& text) {
  StoredJobSpec spec;
  const absl::StatusOr<Json> parsed = ParseJson<Json>(text, kLimits);
  if (!parsed.ok())
    return absl::DataLossError(absl::StrCat("a camera job's specification ", parsed.status().message()));
  const Json& json = *parsed;
  try {
    for (const Json& target : json.at("targets").get_ref<const Json::array_t&>()) {
      MW_ASSIGN_OR_RETURN(spec.targets.emplace_back(), NumberOf<CameraIndex>(target));
    }
    for (const Json& bytes : json.at("memory_bytes").get_ref<const Json::array_t&>()) {
      MW_ASSIGN_OR_RETURN(spec.memory_bytes.emplace_back(), NumberOf<int64_t>(bytes));
    }
    for (const Json& surface : json.at("accepted").get_ref<const Json::array_t&>()) {
      AcceptedSurface& accepted = spec.accepted.emplace_back();
      MW_ASSIGN_OR_RETURN(accepted.sequence, NumberOf<SequenceNumber>(surface.at(0)));
      MW_ASSIGN_OR_RETURN(accepted.camera, NumberOf<CameraIndex>(surface.at(1)));
      accepted.digest = surface.at(2).get<std::string>();
      MW_ASSIGN_OR_RETURN(accepted.patches, NumberOf<int64_t>(surface.at(3)));
    }
  } catch (const Json::exception& error) {
    return absl::DataLossError(absl::StrCat("not a camera job's specification: ", error.what()));
  }
  return spec;
}

std::string EncodePhotographs(const std::vector<StoredPhotograph>& photographs) {
  Json json = {{"photographs", Json::array()}};
  for (const StoredPhotograph& photograph : photographs) {
    json["photographs"].push_back({photograph.path, photograph.digest});
  }
  return JsonText(json);
}

absl::StatusOr<std::vector<StoredPhotograph>> DecodePhotographs(const std::string& text) {
  const absl::StatusOr<Json> json = ParseJson<Json>(text, kLimits);
  if (!json.ok()) return absl::DataLossError(absl::StrCat("a list of photographs ", json.status().message()));
  std::vector<StoredPhotograph> photographs;
  try {
    for (const Json& photograph : json->at("photographs").get_ref<const Json::array_t&>()) {
      photographs.push_back(
          {.path = photograph.at(0).get<std::string>(), .digest = photograph.at(1).get<std::string>()});
    }
  } catch (const Json::exception& error) {
    return absl::DataLossError(absl::StrCat("not a list of photographs: ", error.what()));
  }
  return photographs;
}

}  // namespace meshwright
