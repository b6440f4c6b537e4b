#include "coordinator/rest/rest_server.h"

#include <algorithm>
#include <thread>
#include <utility>

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_split.h>
#include <absl/strings/strip.h>

#include "common/base/digest.h"
#include "common/base/status_macros.h"
#include "common/http_server/http_server.h"
#include "coordinator/rest/problem.h"
#include "coordinator/rest/routes.h"
#include "coordinator/rest/static_pages.h"

namespace meshwright {
namespace {

constexpr char kTokenCookie[] = "meshwright-token";
constexpr char kRetryAfterSeconds[] = "1";
constexpr int kMinWorkers = 4;
constexpr absl::Duration kShutdownGrace = absl::Seconds(2);

std::string TokenOf(const HttpRequest& request) {
  const std::string header = request.headers.Get("Authorization");
  constexpr char kBearer[] = "Bearer ";
  if (absl::StartsWith(header, kBearer)) return header.substr(sizeof(kBearer) - 1);
  for (absl::string_view cookie : absl::StrSplit(request.headers.Get("Cookie"), ';')) {
    cookie = absl::StripAsciiWhitespace(cookie);
    if (absl::ConsumePrefix(&cookie, kTokenCookie) && absl::ConsumePrefix(&cookie, "=")) return std::string(cookie);
  }
  return "";
}

// Whether the request is another site's doing, in the browser of somebody who can reach this one.
bool IsForeign(const HttpRequest& request) {
  if (request.method == "GET" || request.method == "HEAD") return false;
  const std::string origin = request.headers.Get("Origin");
  const size_t host = origin.find("://");
  return !origin.empty() && (host == std::string::npos || origin.substr(host + 3) != request.headers.Get("Host"));
}

void AddDefaultHeaders(HttpResponse& response) {
  response.headers.Set("X-Content-Type-Options", "nosniff");
  response.headers.Set("Referrer-Policy", "no-referrer");
}

class RealRestServer final : public RestServer, private HttpHandler {
 public:
  RealRestServer(const RestOptions& options, const RestServices& services)
      : options_(options), token_digest_(Sha256Hex(options.token)) {
    context_.reconstructions = services.reconstructions;
    context_.workers = services.workers;
    context_.blobs = services.blobs;
    context_.ready = services.ready;
    context_.options_json = services.options_json;
  }
  ~RealRestServer() override { Shutdown(); }

  absl::Status Open() {
    MW_ASSIGN_OR_RETURN(uploads_, SceneUploads::Open(options_.folder + "/uploads", *context_.reconstructions));
    MW_ASSIGN_OR_RETURN(derived_, DerivedFiles::Open(options_.folder + "/derived"));
    feeds_ = std::make_unique<EventFeeds>(
        *context_.reconstructions, EventFeedOptions{.max_streams = options_.max_event_streams,
                                                    .max_streams_per_caller = options_.max_event_streams_per_caller});
    context_.uploads = uploads_.get();
    context_.derived = derived_.get();
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
    if (for_interface && !options_.token.empty() && Sha256Hex(TokenOf(request)) != token_digest_) {
      return absl::UnauthenticatedError("the header Authorization is not the one expected: Bearer and the token");
    }
    if (IsForeign(request)) {
      return FieldError("Origin", absl::PermissionDeniedError("Origin is another site, expected this one or none"));
    }
    const absl::StatusOr<const Route*> route = router_->Match(call);
    if (route.ok()) return (*route)->handler(call);
    if (!absl::IsNotFound(route.status()) || for_interface || (request.method != "GET" && request.method != "HEAD")) {
      return route.status();
    }
    return SendPage(call, options_.page_folder);
  }

  const RestOptions options_;
  const std::string token_digest_;
  RestContext context_;
  std::unique_ptr<SceneUploads> uploads_;
  std::unique_ptr<DerivedFiles> derived_;
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
// SPDX-License-Identifier: Apache-2.0
