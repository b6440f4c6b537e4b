// SPDX-License-Identifier: Apache-2.0
#include <functional>
#include <memory>
#include <string>
#include <utility>

#include <absl/strings/match.h>
#include <absl/strings/numbers.h>
#include <absl/strings/str_cat.h>
#include <absl/types/span.h>

#include "common/base/status_macros.h"
#include "coordinator/api/guarded_calls.h"
#include "coordinator/rest/camera_json.h"
#include "coordinator/rest/json.h"
#include "coordinator/rest/problem.h"
#include "coordinator/rest/routes.h"

namespace meshwright {
namespace {

constexpr int64_t kMaxJsonBytes = int64_t{1} << 20;
constexpr int64_t kMaxAttempts = 100'000;
constexpr int64_t kMaxSequence = 2'000'000'000;

absl::Status Answer(RestCall& call, const absl::StatusOr<v1::Reconstruction>& reconstruction) {
  MW_RETURN_IF_ERROR(reconstruction.status());
  call.response.status = 200;
  call.response.SetContent(ToJson(*reconstruction), kJsonType);
  return absl::OkStatus();
}

// Reads the body, hands it to `create` and answers with what that gives.
absl::Status TakeCreateRequest(RestCall& call,
                               std::function<absl::StatusOr<v1::Reconstruction>(
                                   const Caller& caller, const v1::CreateReconstructionRequest& request)>
                                   create) {
  const std::string type = call.request.headers.Get("Content-Type");
  if (!absl::StartsWithIgnoreCase(type, kJsonType)) {
    return HttpError(415, FieldError("Content-Type",
                                     absl::InvalidArgumentError(absl::StrCat("Content-Type is \"", type.substr(0, 64),
                                                                             "\", expected application/json"))));
  }
  const auto body = std::make_shared<std::string>();
  return TakeBody(
      call, kMaxJsonBytes,
      [body](absl::Span<const uint8_t> bytes) {
        body->append(bytes.begin(), bytes.end());
        return absl::OkStatus();
      },
      [create = std::move(create), body](RestCall& taken) -> absl::Status {
        v1::CreateReconstructionRequest request;
        MW_RETURN_IF_ERROR(FromJson(*body, request));
        return Answer(taken, create(taken.caller, request));
      });
}

absl::Status Create(const RestContext& context, RestCall& call) {
  return TakeCreateRequest(call, [&context](const Caller& caller, const v1::CreateReconstructionRequest& request) {
    return CreateFor(caller, *context.gate, *context.reconstructions, request);
  });
}

absl::Status Again(const RestContext& context, RestCall& call) {
  return TakeCreateRequest(call, [&context, source = call.path.at("id")](
                                     const Caller& caller, const v1::CreateReconstructionRequest& request) {
    return CreateAgainFor(caller, *context.gate, *context.reconstructions, source, request);
  });
}

absl::Status List(const RestContext& context, RestCall& call) {
  v1::ListReconstructionsRequest request;
  MW_ASSIGN_OR_RETURN(const int64_t page_size, QueryNumber(call, "pageSize", 0, 1000, 0));
  request.set_page_size(static_cast<int32_t>(page_size));
  request.set_page_token(call.request.Param("pageToken"));
  MW_ASSIGN_OR_RETURN(const v1::ListReconstructionsResponse response,
                      ListFor(call.caller, *context.reconstructions, request));
  call.response.SetContent(ToJson(response), kJsonType);
  return absl::OkStatus();
}

absl::Status Delete(const RestContext& context, RestCall& call) {
  MW_RETURN_IF_ERROR(context.reconstructions->Delete(call.path.at("id")));
  context.uploads->Sweep();
  context.gate->ReleaseSceneBytes(call.path.at("id"));
  call.response.status = 204;
  return absl::OkStatus();
}

absl::Status Start(const RestContext& context, RestCall& call) {
  MW_RETURN_IF_ERROR(Answer(call, context.reconstructions->Start(call.path.at("id"))));
  context.uploads->Sweep();
  context.gate->ReleaseSceneBytes(call.path.at("id"));
  return absl::OkStatus();
}

// The part that a client knows, 0 when it does not say.
absl::StatusOr<int64_t> LastPart(const RestCall& call) {
  if (!call.request.headers.Has("Last-Event-ID")) return QueryNumber(call, "lastEventId", 0, kMaxSequence, 0);
  const std::string text = call.request.headers.Get("Last-Event-ID");
  int64_t sequence = 0;
  if (!absl::SimpleAtoi(text, &sequence) || sequence < 0 || sequence > kMaxSequence) {
    return FieldError("Last-Event-ID",
                      absl::InvalidArgumentError(
                          absl::StrCat("Last-Event-ID is \"", text.substr(0, 64), "\", expected the id of an event")));
  }
  return sequence;
}

absl::Status Events(const RestContext& context, RestCall& call) {
  MW_ASSIGN_OR_RETURN(const int64_t last_part, LastPart(call));
  // One user's streams are counted together, wherever they come from.
  const std::string& follower = context.gate->is_open() ? call.request.caller : call.caller.user;
  auto opened = context.feeds->Open(call.path.at("id"), follower, last_part);
  if (absl::IsUnavailable(opened.status()) || absl::IsResourceExhausted(opened.status()))
    call.response.headers.Set("Retry-After", "5");
  MW_RETURN_IF_ERROR(opened.status());
  call.response.status = 200;
  call.response.headers.Set("Cache-Control", "no-store");
  call.response.headers.Set("X-Accel-Buffering", "no");  // nginx would keep events back
  call.response.SetEvents("text/event-stream", *std::move(opened));
  return absl::OkStatus();
}

template <typename Response>
absl::Status AnswerAny(RestCall& call, const absl::StatusOr<Response>& response) {
  MW_RETURN_IF_ERROR(response.status());
  call.response.SetContent(ToJson(*response), kJsonType);
  return absl::OkStatus();
}

absl::Status Cameras(const RestContext& context, RestCall& call) {
  MW_ASSIGN_OR_RETURN(const nlohmann::ordered_json cameras, CamerasJson(*context.reconstructions, call.path.at("id")));
  call.response.SetContent(Dump(cameras), kJsonType);
  return absl::OkStatus();
}

absl::Status Attempts(const RestContext& context, RestCall& call) {
  v1::ListAttemptsRequest request;
  request.set_id(call.path.at("id"));
  MW_ASSIGN_OR_RETURN(const int64_t max_attempts, QueryNumber(call, "maxAttempts", 0, kMaxAttempts, 0));
  request.set_max_attempts(static_cast<int32_t>(max_attempts));
  return AnswerAny(call, context.reconstructions->ListAttempts(request));
}

absl::Status Log(const RestContext& context, RestCall& call) {
  MW_ASSIGN_OR_RETURN(const nlohmann::ordered_json log, LogJson(*context.reconstructions, call.path.at("id")));
  call.response.SetContent(Dump(log), kJsonType);
  return absl::OkStatus();
}

}  // namespace

void AddReconstructionRoutes(const RestContext& context, std::vector<Route>& routes) {
  const auto add = [&](const char* method, const char* path, std::vector<std::string> query, auto handler) {
    routes.push_back({method, path, std::move(query),
                      [&context, handler](RestCall& call) -> absl::Status { return handler(context, call); }});
  };
  add("GET", "/v1/reconstructions", {"pageSize", "pageToken"}, List);
  add("POST", "/v1/reconstructions", {}, Create);
  add("POST", "/v1/reconstructions/{id}:start", {}, Start);
  add("POST", "/v1/reconstructions/{id}:again", {}, Again);
  add("POST", "/v1/reconstructions/{id}:cancel", {}, [](const RestContext& to, RestCall& call) {
    return Answer(call, to.reconstructions->Cancel(call.path.at("id")));
  });
  add("GET", "/v1/reconstructions/{id}", {},
      [](const RestContext& to, RestCall& call) { return Answer(call, to.reconstructions->Get(call.path.at("id"))); });
  add("DELETE", "/v1/reconstructions/{id}", {}, Delete);
  add("GET", "/v1/reconstructions/{id}/events", {"lastEventId"}, Events);
  add("GET", "/v1/reconstructions/{id}/cameras", {}, Cameras);
  add("GET", "/v1/reconstructions/{id}/incidence", {}, [](const RestContext& to, RestCall& call) {
    return AnswerAny(call, to.reconstructions->GetIncidence(call.path.at("id")));
  });
  add("GET", "/v1/reconstructions/{id}/attempts", {"maxAttempts"}, Attempts);
  add("GET", "/v1/reconstructions/{id}/log", {}, Log);
}

}  // namespace meshwright
