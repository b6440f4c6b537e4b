// SPDX-License-Identifier: Apache-2.0
#include "coordinator/rest/problem.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <optional>

#include <absl/strings/ascii.h>
#include <absl/strings/cord.h>
#include <absl/strings/numbers.h>
#include <absl/strings/str_cat.h>
#include <nlohmann/json.hpp>

#include "common/json/json_text.h"
#include "coordinator/api/public_text.h"

namespace meshwright {
namespace {

constexpr char kFieldPayload[] = "meshwright/field";
constexpr char kHttpStatusPayload[] = "meshwright/http-status";

struct HttpTitle {
  int status;
  const char* title;
};
constexpr std::array<HttpTitle, 21> kTitles = {{{400, "Bad Request"},
                                                {401, "Unauthorized"},
                                                {403, "Forbidden"},
                                                {404, "Not Found"},
                                                {405, "Method Not Allowed"},
                                                {408, "Request Timeout"},
                                                {409, "Conflict"},
                                                {411, "Length Required"},
                                                {413, "Content Too Large"},
                                                {414, "URI Too Long"},
                                                {415, "Unsupported Media Type"},
                                                {416, "Range Not Satisfiable"},
                                                {417, "Expectation Failed"},
                                                {422, "Unprocessable Content"},
                                                {429, "Too Many Requests"},
                                                {431, "Request Header Fields Too Large"},
                                                {500, "Internal Server Error"},
                                                {501, "Not Implemented"},
                                                {503, "Service Unavailable"},
                                                {504, "Gateway Timeout"},
                                                {507, "Insufficient Storage"}}};

const char* TitleOf(int http_status) {
  for (const HttpTitle& title : kTitles) {
    if (title.status == http_status) return title.title;
  }
  return http_status < 500 ? "Bad Request" : "Internal Server Error";
}

// The names of fields that messages of the service behind this interface begin with.
bool IsField(const std::string& name) {
  static constexpr std::array<const char*, 11> kFields = {
      "id",   "options_json", "scene_reference", "weight", "page_size", "page_token",
      "path", "size_bytes",   "worker_id",       "sha256", "sequence"};
  return std::find(kFields.begin(), kFields.end(), name) != kFields.end();
}

std::string CamelCase(const std::string& snake_case) {
  std::string name;
  bool upper = false;
  for (const char c : snake_case) {
    if (c == '_') {
      upper = true;
      continue;
    }
    name.push_back(upper ? absl::ascii_toupper(static_cast<unsigned char>(c)) : c);
    upper = false;
  }
  return name;
}

std::optional<std::string> FieldOf(const absl::Status& status) {
  if (const auto payload = status.GetPayload(kFieldPayload)) return std::string(*payload);
  if (!absl::IsInvalidArgument(status) && !absl::IsAlreadyExists(status) && !absl::IsNotFound(status)) {
    return std::nullopt;
  }
  const std::string message(status.message());
  const auto end = std::find_if(message.begin(), message.end(), [](unsigned char c) {
    return !absl::ascii_islower(c) && !absl::ascii_isdigit(c) && c != '_';
  });
  const std::string name(message.begin(), end);
  if (!IsField(name)) return std::nullopt;
  return CamelCase(name);
}

}  // namespace

absl::Status FieldError(const std::string& field, absl::Status status) {
  status.SetPayload(kFieldPayload, absl::Cord(field));
  return status;
}

absl::Status HttpError(int http_status, absl::Status status) {
  status.SetPayload(kHttpStatusPayload, absl::Cord(absl::StrCat(http_status)));
  return status;
}

int HttpStatusOf(const absl::Status& status) {
  if (const auto payload = status.GetPayload(kHttpStatusPayload)) {
    int http_status = 500;
    if (absl::SimpleAtoi(std::string(*payload), &http_status)) return http_status;
  }
  switch (status.code()) {
    case absl::StatusCode::kOk:
      return 200;
    case absl::StatusCode::kInvalidArgument:
    case absl::StatusCode::kOutOfRange:
      return 400;
    case absl::StatusCode::kUnauthenticated:
      return 401;
    case absl::StatusCode::kPermissionDenied:
      return 403;
    case absl::StatusCode::kNotFound:
      return 404;
    case absl::StatusCode::kAlreadyExists:
    case absl::StatusCode::kFailedPrecondition:
    case absl::StatusCode::kAborted:
      return 409;
    case absl::StatusCode::kResourceExhausted:
      return 429;
    case absl::StatusCode::kUnimplemented:
      return 501;
    case absl::StatusCode::kUnavailable:
    case absl::StatusCode::kCancelled:
      return 503;
    case absl::StatusCode::kDeadlineExceeded:
      return 504;
    default:
      return 500;
  }
}

std::string ProblemJson(const absl::Status& status) {
  const int http_status = HttpStatusOf(status);
  nlohmann::ordered_json problem;
  problem["type"] = "about:blank";
  problem["title"] = TitleOf(http_status);
  problem["status"] = http_status;
  problem["detail"] = WithoutServerPaths(std::string(status.message()));
  problem["code"] = absl::StatusCodeToString(status.code());
  if (const std::optional<std::string> field = FieldOf(status)) problem["field"] = *field;
  // Messages quote what came from outside, which need not be text.
  return JsonText(problem);
}

absl::Status StatusOfFault(const HttpFault& fault) {
  absl::StatusCode code = fault.status < 500 ? absl::StatusCode::kInvalidArgument : absl::StatusCode::kInternal;
  if (fault.status == 501) code = absl::StatusCode::kUnimplemented;
  if (fault.status == 503) code = absl::StatusCode::kUnavailable;
  std::string detail = fault.detail;
  if (detail.empty()) detail = TitleOf(fault.status);
  if (fault.detail.empty() && fault.status == 400) detail = "the request cannot be read as HTTP/1.1";
  if (fault.detail.empty() && fault.status == 414) detail = "the path is longer than anything that is there";
  const absl::Status status = HttpError(fault.status, absl::Status(code, detail));
  return fault.field.empty() ? status : FieldError(fault.field, status);
}

}  // namespace meshwright
