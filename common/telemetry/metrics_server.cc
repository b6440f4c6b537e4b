#include "common/telemetry/metrics_server.h"

#include <thread>
#include <utility>

#include <absl/strings/numbers.h>
#include <absl/strings/str_cat.h>
#include <httplib.h>

namespace meshwright {
namespace {

constexpr char kMetricsType[] = "text/plain; version=0.0.4; charset=utf-8";
constexpr char kText[] = "text/plain; charset=utf-8";
constexpr size_t kThreads = 2;  // scrapers and probes are few, and a slow one must not keep the others waiting
constexpr int kIdleTimeoutSeconds = 5;
constexpr size_t kMaxRequestBytes = 1024;

class HttpMetricsServer final : public MetricsServer {
 public:
  HttpMetricsServer(const Metrics& metrics, std::function<absl::Status()> ready)
      : metrics_(metrics), ready_(std::move(ready)) {
    server_.new_task_queue = [] { return new httplib::ThreadPool(kThreads); };
    server_.set_read_timeout(kIdleTimeoutSeconds);
    server_.set_write_timeout(kIdleTimeoutSeconds);
    server_.set_keep_alive_max_count(1);
    server_.set_payload_max_length(kMaxRequestBytes);
    server_.Get("/metrics", [this](const httplib::Request&, httplib::Response& response) {
      response.set_content(metrics_.Text(), kMetricsType);
    });
    server_.Get("/healthz",
                [](const httplib::Request&, httplib::Response& response) { response.set_content("ok\n", kText); });
    server_.Get("/readyz", [this](const httplib::Request&, httplib::Response& response) {
      const absl::Status status = ready_();
      response.status = status.ok() ? 200 : 503;
      response.set_content(status.ok() ? "ok\n" : absl::StrCat(status.message(), "\n"), kText);
    });
  }

  ~HttpMetricsServer() override {
    server_.stop();
    if (listener_.joinable()) listener_.join();
  }

  absl::Status Listen(const std::string& address) {
    const size_t colon = address.rfind(':');
    int port = -1;
    if (colon == std::string::npos || colon == 0 || !absl::SimpleAtoi(address.substr(colon + 1), &port) || port < 0 ||
        port > 65535) {
      return absl::InvalidArgumentError(absl::StrCat("metrics address \"", address, "\": host:port expected"));
    }
    std::string host = address.substr(0, colon);
    if (host.size() > 2 && host.front() == '[' && host.back() == ']') host = host.substr(1, host.size() - 2);
    // The default shares the port with whoever else asks for it: two workers would answer in turns.
    server_.set_socket_options([](socket_t socket) {
      const int yes = 1;
      ::setsockopt(socket, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof(yes));
    });
    if (port == 0) {
      port_ = server_.bind_to_any_port(host.c_str());
    } else {
      port_ = server_.bind_to_port(host.c_str(), port) ? port : -1;
    }
    if (port_ <= 0) return absl::UnavailableError(absl::StrCat("cannot listen on ", address, " for metrics"));
    listener_ = std::thread([this] { server_.listen_after_bind(); });
    // stop() does nothing before the server runs.
    while (!server_.is_running()) std::this_thread::yield();
    return absl::OkStatus();
  }

  int port() const override { return port_; }

 private:
  const Metrics& metrics_;
  const std::function<absl::Status()> ready_;
  httplib::Server server_;
  int port_ = 0;
  std::thread listener_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<MetricsServer>> MetricsServer::Start(const std::string& address, const Metrics& metrics,
                                                                    std::function<absl::Status()> ready) {
  auto server = std::make_unique<HttpMetricsServer>(metrics, std::move(ready));
  if (absl::Status status = server->Listen(address); !status.ok()) return status;
  return server;
}

}  // namespace meshwright
