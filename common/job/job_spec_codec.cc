// SPDX-License-Identifier: Apache-2.0
#include "common/job/job_spec_codec.h"

#include <absl/strings/str_cat.h>
#include <nlohmann/json.hpp>

#include "common/json/json_text.h"
#include "common/json/parse_json.h"

namespace meshwright {

using Json = nlohmann::ordered_json;

namespace {

// A job may look at many surfaces that were accepted before.
constexpr JsonLimits kLimits = {.max_bytes = size_t{256} << 20, .max_depth = 3};

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
    spec.targets = json.at("targets").get<std::vector<CameraIndex>>();
    spec.memory_bytes = json.at("memory_bytes").get<std::vector<int64_t>>();
    for (const Json& surface : json.at("accepted")) {
      spec.accepted.push_back({.sequence = surface.at(0).get<SequenceNumber>(),
                               .camera = surface.at(1).get<CameraIndex>(),
                               .digest = surface.at(2).get<std::string>(),
                               .patches = surface.at(3).get<int64_t>()});
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
    for (const Json& photograph : json->at("photographs")) {
      photographs.push_back(
          {.path = photograph.at(0).get<std::string>(), .digest = photograph.at(1).get<std::string>()});
    }
  } catch (const Json::exception& error) {
    return absl::DataLossError(absl::StrCat("not a list of photographs: ", error.what()));
  }
  return photographs;
}

}  // namespace meshwright
