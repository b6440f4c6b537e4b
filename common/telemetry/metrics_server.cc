// SPDX-License-Identifier: Apache-2.0
#include "common/telemetry/metrics_server.h"

#include <utility>

#include <absl/strings/str_cat.h>

#include "common/base/status_macros.h"
#include "common/http_server/http_server.h"

namespace meshwright {
namespace {

constexpr char kMetricsType[] = "text/plain; version=0.0.4; charset=utf-8";
constexpr char kText[] = "text/plain; charset=utf-8";
constexpr int kMaxConnections = 64;  // scrapers and probes are few

class HttpMetricsServer final : public MetricsServer, private HttpHandler {
 public:
  HttpMetricsServer(const Metrics& metrics, std::function<absl::Status()> ready)
      : metrics_(metrics), ready_(std::move(ready)) {}

  absl::Status Listen(const std::string& address) {
    auto started = HttpServer::Start({.listen = address,
                                      .io_threads = 1,
                                      .worker_threads = 2,
                                      .max_connections = kMaxConnections,
                                      .max_connections_per_address = kMaxConnections / 2},
                                     *this);
    if (!started.ok()) {
      return absl::Status(started.status().code(), absl::StrCat("metrics: ", std::string(started.status().message())));
    }
    server_ = *std::move(started);
    return absl::OkStatus();
  }

  int port() const override { return server_->port(); }

 private:
  bool IsQuick(const HttpRequest& request) const override { return request.path == "/healthz"; }

  void Handle(HttpExchange& exchange) override {
    const HttpRequest& request = exchange.request;
    HttpResponse& response = exchange.response;
    const bool reads = request.method == "GET" || request.method == "HEAD";
    if (reads && request.path == "/metrics") {
      response.SetContent(metrics_.Text(), kMetricsType);
    } else if (reads && request.path == "/healthz") {
      response.SetContent("ok\n", kText);
    } else if (reads && request.path == "/readyz") {
      const absl::Status status = ready_();
      response.status = status.ok() ? 200 : 503;
      response.SetContent(status.ok() ? "ok\n" : absl::StrCat(std::string(status.message()), "\n"), kText);
    } else {
      response.status = 404;
    }
  }

  void AnswerFault(const HttpFault& fault, HttpResponse& response) override {
    response.status = fault.status;
    response.SetContent(fault.detail + "\n", kText);
  }

  const Metrics& metrics_;
  const std::function<absl::Status()> ready_;
  std::unique_ptr<HttpServer> server_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<MetricsServer>> MetricsServer::Start(const std::string& address, const Metrics& metrics,
                                                                    std::function<absl::Status()> ready) {
  auto server = std::make_unique<HttpMetricsServer>(metrics, std::move(ready));
  if (absl::Status status = server->Listen(address); !status.ok()) return status;
  return server;
}

}  // namespace meshwright
