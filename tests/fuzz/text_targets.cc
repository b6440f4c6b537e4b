// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <string>
#include <vector>

#include <absl/strings/str_cat.h>

#include "pipeline/cameras/colmap_output.h"
#include "pipeline/options/option_table.h"
#include "pipeline/options/options_json.h"
#include "program/settings_file.h"

#include "common/base/check.h"
#include "common/base/host_port.h"
#include "common/base/relative_path.h"
#include "common/http_server/request_parser.h"
#include "common/job/camera_refinement.h"
#include "common/job/job_spec_codec.h"
#include "common/json/parse_json.h"
#include "tests/fuzz/target.h"

namespace meshwright::fuzz {
namespace {

void ReadJson(const std::string& bytes) {
  const absl::StatusOr<nlohmann::json> json = ParseJson(bytes);
  if (!json.ok()) return;
  // Whoever takes it prints, copies and compares it.
  const nlohmann::json copy = *json;
  MW_CHECK(copy == *json || json->dump().find("nan") != std::string::npos);
  const absl::StatusOr<nlohmann::json> again = ParseJson(json->dump(), {.max_bytes = size_t{1} << 20});
  MW_CHECK(again.ok());
}

void ReadOptions(const std::string& bytes) {
  const absl::StatusOr<ReconstructionOptions> options = ParseOptions(bytes);
  if (!options.ok()) return;
  MW_CHECK(options->Validate().ok() && CheckOptions(*options, "").ok());
  const std::string text = ToJson(*options).dump();
  const absl::StatusOr<ReconstructionOptions> again = ParseOptions(text);
  MW_CHECK(again.ok() && ToJson(*again).dump() == text);
}

void ReadSettings(const std::string& bytes) {
  const absl::StatusOr<std::vector<Setting>> settings = ParseSettingsFile("settings.conf", bytes);
  if (!settings.ok()) return;
  for (const Setting& setting : *settings) MW_CHECK(!setting.name.empty() && !setting.source.empty());
}

// What a worker says of the cameras.
void ReadRefinedCameras(const std::string& bytes) {
  const absl::StatusOr<CameraRefinement> refinement = DecodeCameraRefinement(bytes);
  if (!refinement.ok()) return;
  for (const Rigid3& pose : refinement->cam_from_world) {
    MW_CHECK(pose.rotation.allFinite() && pose.translation.allFinite());
  }
  Scene scene;
  scene.views.resize(refinement->cam_from_world.size());
  MW_CHECK(ApplyRefinement(*refinement, scene).ok());
  const std::string encoded = EncodeCameraRefinement(*refinement);
  MW_CHECK(EncodeCameraRefinement(DecodeCameraRefinement(encoded).value()) == encoded);
}

void ReadJobSpec(const std::string& bytes) {
  const absl::StatusOr<StoredJobSpec> spec = DecodeJobSpec(bytes);
  if (!spec.ok()) return;
  const std::string encoded = EncodeJobSpec(*spec);
  const absl::StatusOr<StoredJobSpec> again = DecodeJobSpec(encoded);
  MW_CHECK(again.ok() && EncodeJobSpec(*again) == encoded);
}

void ReadAddress(const std::string& bytes) {
  const absl::StatusOr<HostPort> address = ParseHostPort(bytes, "--listen");
  if (address.ok()) {
    MW_CHECK(address->port >= 0 && address->port <= 65535);
    const absl::StatusOr<HostPort> again = ParseHostPort(ToString(*address), "--listen");
    MW_CHECK(again.ok() && again->host == address->host && again->port == address->port);
  }
  if (ValidateRelativePath(bytes).ok()) MW_CHECK(bytes.find("..") == std::string::npos || bytes.size() > 2);
}

// A request as the HTTP server reads it: the head, and what follows as a chunked body.
void ReadRequest(const std::string& bytes) {
  const size_t end = bytes.find("\r\n\r\n");
  if (end == std::string::npos) return;
  RequestParser parser;
  HttpRequest request;
  const auto fault =
      parser.ParseHead(bytes.substr(0, end + 4), {.max_start_line_bytes = 8192, .max_fields = 100}, request);
  if (fault) {
    MW_CHECK(fault->status >= 400 && fault->status < 600);
    return;
  }
  MW_CHECK(parser.content_bytes() >= 0);
  MW_CHECK(!request.method.empty() && request.path.rfind('/', 0) == 0);
  if (!parser.has_chunked_body()) return;
  std::string rest = bytes.substr(end + 4);
  while (!rest.empty() && !parser.has_ended()) {
    std::string room(1000, '\0');
    size_t used = 0;
    size_t decoded = 0;
    if (!parser.DecodeChunked(rest, absl::MakeSpan(room), &used, &decoded)) return;
    MW_CHECK(used <= rest.size() && decoded <= room.size());
    if (used == 0 && decoded == 0) return;
    rest.erase(0, used);
  }
}

void ReadColmapOutput(const std::string& bytes) {
  for (const CameraStep step : {CameraStep::kFeatures, CameraStep::kMatching, CameraStep::kMapping}) {
    ColmapOutput output(step, 10);
    for (size_t begin = 0; begin < bytes.size();) {
      const size_t end = std::min(bytes.find('\n', begin), bytes.size());
      output.Read(bytes.substr(begin, end - begin));
      begin = end + 1;
    }
    MW_CHECK(output.done() >= 0 && output.total() >= 0);
  }
}

std::vector<std::string> OptionNames() {
  std::vector<std::string> names = {"version", "true", "1e999", "-0", "2147483648", "{", "[["};
  for (const Option& option : OptionTable()) names.push_back(absl::StrCat("\"", option.name, "\":"));
  return names;
}

}  // namespace

std::vector<Target> TextTargets() {
  const std::string head = "POST /v1/reconstructions?pageSize=3&a=%20 HTTP/1.1\r\nHost: a.example\r\n";
  return {
      {"json",
       ReadJson,
       {R"({"a": [1, 2.5, null, true], "b": {"c": "d\u00e9"}})", "[]", "1e300"},
       {"\\u", "[[", "{\""}},
      {"options", ReadOptions, {"", "{}", ToJson(ReconstructionOptions()).dump()}, OptionNames()},
      {"settings",
       ReadSettings,
       {"# a comment\nlisten = 127.0.0.1:7420\nscene-root = \"/data/a b\"\n\n; another\n", "data='x'\r\n"},
       {" = ", "\"", "'", "#", "listen"}},
      {"refined_cameras",
       ReadRefinedCameras,
       {EncodeCameraRefinement({.cam_from_world = {Rigid3()}, .tie_points = 9, .off_px = 0.5}),
        EncodeCameraRefinement({.reason = "not asked for"})},
       {"cam_from_world", "[[", "1e308", "null"}},
      {"job_spec",
       ReadJobSpec,
       {EncodeJobSpec({.targets = {1, 2},
                       .accepted = {{.sequence = 1, .camera = 3, .digest = std::string(64, 'a'), .patches = 10}},
                       .memory_bytes = {100, 50}}),
        EncodeJobSpec({})},
       {"targets", "accepted", "memory_bytes", "-1", "1e99"}},
      {"address", ReadAddress, {"localhost:7420", "[::1]:0", "a/b/c.png"}, {"[", "]:", "65536", "..", "/"}},
      {"http",
       ReadRequest,
       {head + "Content-Length: 2\r\n\r\n{}", head + "Transfer-Encoding: chunked\r\n\r\n3\r\nabc\r\n0\r\n\r\n",
        "GET http://a.example/x?y HTTP/1.0\r\nConnection: keep-alive\r\nRange: bytes=0-4\r\n\r\n"},
       {"Transfer-Encoding: chunked\r\n", "Content-Length: ", "HTTP/1.0", "Expect: 100-continue\r\n", "\r\n\r\n",
        "Host: ", "%00", ";x=y"}},
      {"colmap_output",
       ReadColmapOutput,
       {"Processed file [3/10]\nMatching block [1/2, 2/2] in 0.1s\nRegistering image #4 (5)\n",
        "E0101 00:00:00 1 x.cc:1] Check failed: two\n"},
       {"Processed file [", "Matching image [", "Registering image #", "=> Registered "}},
  };
}

}  // namespace meshwright::fuzz
