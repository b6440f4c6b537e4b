// SPDX-License-Identifier: Apache-2.0
#include "coordinator/rest/rest_server.h"

#include <algorithm>
#include <optional>
#include <thread>
#include <utility>

#include <absl/strings/ascii.h>
#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_split.h>
#include <absl/strings/strip.h>

#include "common/base/status_macros.h"
#include "common/http_server/foreign_requests.h"
#include "common/http_server/http_server.h"
#include "coordinator/rest/problem.h"
#include "coordinator/rest/routes.h"
#include "coordinator/rest/static_pages.h"

namespace meshwright {
namespace {

constexpr char kTokenCookie[] = "meshwright-token";
// Pages of other sites cannot send it without asking first, and nobody answers that they may.
constexpr char kCsrfHeader[] = "X-Meshwright-Csrf";
constexpr char kSessionPath[] = "/v1/session";
constexpr char kRetryAfterSeconds[] = "1";
constexpr int kMinWorkers = 4;
constexpr absl::Duration kShutdownGrace = absl::Seconds(2);

struct ShownKey {
  std::string text;
  bool by_cookie = false;  // the browser sends it by itself, whichever page asks
};

ShownKey KeyOf(const HttpRequest& request) {
  const std::string header = request.headers.Get("Authorization");
  constexpr char kBearer[] = "Bearer ";
  if (absl::StartsWith(header, kBearer)) return {.text = header.substr(sizeof(kBearer) - 1)};
  for (absl::string_view cookie : absl::StrSplit(request.headers.Get("Cookie"), ';')) {
    cookie = absl::StripAsciiWhitespace(cookie);
    if (absl::ConsumePrefix(&cookie, kTokenCookie) && absl::ConsumePrefix(&cookie, "=")) {
      return {.text = std::string(cookie), .by_cookie = true};
    }
  }
  return {};
}

// What a route is for, of those that are about somebody's reconstructions or the service; nothing for those that any
// valid key opens.
std::optional<Action> ActionOf(const Route& route) {
  const bool reads = route.method == "GET";
  if (route.path == "/v1/reconstructions") return reads ? Action::kList : Action::kCreate;
  if (absl::StartsWith(route.path, "/v1/reconstructions/")) return reads ? Action::kRead : Action::kChange;
  if (absl::StartsWith(route.path, "/v1/workers")) return reads ? Action::kInspect : Action::kOperate;
  if (reads || route.path == kSessionPath) return std::nullopt;
  return Action::kOperate;
}

void AddDefaultHeaders(HttpResponse& response) {
  response.headers.Set("X-Content-Type-Options", "nosniff");
  response.headers.Set("Referrer-Policy", "no-referrer");
}

class RealRestServer final : public RestServer, private HttpHandler {
 public:
  RealRestServer(const RestOptions& options, const RestServices& services) : options_(options) {
    context_.reconstructions = services.reconstructions;
    context_.workers = services.workers;
    context_.blobs = services.blobs;
    context_.gate = services.gate;
    context_.ready = services.ready;
    context_.options_json = services.options_json;
    context_.write_textured = services.write_textured;
    context_.write_report = services.write_report;
  }
  ~RealRestServer() override { Shutdown(); }

  absl::Status Open() {
    MW_ASSIGN_OR_RETURN(uploads_, SceneUploads::Open(options_.folder + "/uploads", *context_.reconstructions));
    MW_ASSIGN_OR_RETURN(derived_, DerivedFiles::Open(options_.folder + "/derived"));
    MW_ASSIGN_OR_RETURN(textured_, DerivedFiles::Open(options_.folder + "/textured"));
    MW_ASSIGN_OR_RETURN(tilesets_, DerivedFiles::Open(options_.folder + "/tilesets"));
    feeds_ = std::make_unique<EventFeeds>(
        *context_.reconstructions, EventFeedOptions{.max_streams = options_.max_event_streams,
                                                    .max_streams_per_caller = options_.max_event_streams_per_caller});
    context_.uploads = uploads_.get();
    context_.derived = derived_.get();
    context_.textured = textured_.get();
    context_.tilesets = tilesets_.get();
    context_.feeds = feeds_.get();
    router_ = std::make_unique<Router>(MakeRoutes(context_));
    const int cores = static_cast<int>(std::thread::hardware_concurrency());
    auto started = HttpServer::Start({.listen = options_.listen,
                                      .tls_certificate_file = options_.tls_certificate_file,
                                      .tls_key_file = options_.tls_key_file,
                                      .trusted_proxies = options_.trusted_proxies,
                                      .worker_threads = std::max(kMinWorkers, 2 * cores),
                                      .idle_timeout = absl::Seconds(options_.idle_timeout_seconds),
                                      .warn = options_.warn},
                                     *this);
    if (!started.ok()) {
      return absl::Status(started.status().code(), absl::StrCat("rest: ", std::string(started.status().message())));
    }
    server_ = *std::move(started);
    return absl::OkStatus();
  }

  int port() const override { return server_->port(); }

  void Shutdown() override {
    if (feeds_ != nullptr) feeds_->Shutdown();
    if (server_ != nullptr) server_->Shutdown(kShutdownGrace);
  }

 private:
  bool IsQuick(const HttpRequest& request) const override {
    return request.path == "/healthz" && (request.method == "GET" || request.method == "HEAD");
  }

  void Handle(HttpExchange& exchange) override {
    RestCall call = {.request = exchange.request, .response = exchange.response};
    AddDefaultHeaders(exchange.response);
    const absl::Status status = Answer(call);
    AnswerStatus(status, exchange.response);
    if (status.ok()) exchange.body = std::move(call.body);
  }

  void AnswerFault(const HttpFault& fault, HttpResponse& response) override {
    AddDefaultHeaders(response);
    if (fault.status == 503) response.headers.Set("Retry-After", kRetryAfterSeconds);
    AnswerStatus(StatusOfFault(fault), response);
  }

  absl::Status Answer(RestCall& call) {
    const HttpRequest& request = call.request;
    const bool for_interface = request.path == "/v1" || absl::StartsWith(request.path, "/v1/");
    if (IsRebound(request, options_.listen, options_.trusted_proxies)) {
      return FieldError("Host", absl::PermissionDeniedError("Host is no name of this machine, expected localhost"));
    }
    if (for_interface) MW_RETURN_IF_ERROR(Identify(call));
    if (IsForeign(request)) {
      return FieldError("Origin", absl::PermissionDeniedError("Origin is another site, expected this one or none"));
    }
    const absl::StatusOr<const Route*> route = router_->Match(call);
    if (route.ok()) {
      if (for_interface) MW_RETURN_IF_ERROR(Authorize(call, **route));
      return (*route)->handler(call);
    }
    if (!absl::IsNotFound(route.status()) || for_interface || (request.method != "GET" && request.method != "HEAD")) {
      return route.status();
    }
    return SendPage(call, options_.page_folder);
  }

  absl::Status Identify(RestCall& call) {
    const ShownKey key = KeyOf(call.request);
    MW_ASSIGN_OR_RETURN(call.caller, context_.gate->Identify(key.text, call.request.caller));
    if (key.by_cookie && !OnlyReads(call.request) && !call.request.headers.Has(kCsrfHeader)) {
      return FieldError(kCsrfHeader, absl::PermissionDeniedError(absl::StrCat(
                                         kCsrfHeader, " is missing, expected with a key that comes as a cookie")));
    }
    return absl::OkStatus();
  }

  absl::Status Authorize(const RestCall& call, const Route& route) {
    const std::optional<Action> action = ActionOf(route);
    if (!action) return absl::OkStatus();
    const auto id = call.path.find("id");
    return context_.gate->Check(call.caller, {.action = *action,
                                              .deed = absl::StrCat(route.method, " ", route.path),
                                              .reconstruction = id == call.path.end() ? "" : id->second});
  }

  const RestOptions options_;
  RestContext context_;
  std::unique_ptr<SceneUploads> uploads_;
  std::unique_ptr<DerivedFiles> derived_;
  std::unique_ptr<DerivedFiles> textured_;
  std::unique_ptr<DerivedFiles> tilesets_;
  std::unique_ptr<EventFeeds> feeds_;
  std::unique_ptr<Router> router_;
  std::unique_ptr<HttpServer> server_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<RestServer>> RestServer::Start(const RestOptions& options,
                                                              const RestServices& services) {
  auto server = std::make_unique<RealRestServer>(options, services);
  MW_RETURN_IF_ERROR(server->Open());
  return server;
}

}  // namespace meshwright
