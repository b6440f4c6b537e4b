// SPDX-License-Identifier: Apache-2.0
#include "common/http_server/http_server.h"

#include <algorithm>
#include <thread>
#include <utility>
#include <vector>

#include <absl/strings/str_cat.h>
#include <boost/asio/executor_work_guard.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/strand.hpp>
#include <sys/resource.h>

#include "common/base/clock.h"
#include "common/base/host_port.h"
#include "common/base/status_macros.h"
#include "common/http_server/connection.h"
#include "common/http_server/tls_files.h"

namespace meshwright {
namespace {

namespace net = boost::asio;
using Tcp = net::ip::tcp;
using ErrorCode = boost::system::error_code;

constexpr int kBacklog = 4096;
constexpr rlim_t kOtherFiles = 512;
constexpr std::chrono::milliseconds kAcceptAgain(100);
constexpr absl::Duration kDestructorGrace = absl::Seconds(1);

// Who is counted as one: an IPv4 address, or an IPv6 network of 64 bits, as one customer gets it.
std::string CountedAddress(const net::ip::address& address) {
  if (address.is_v4()) return address.to_string();
  auto bytes = address.to_v6().to_bytes();
  if (address.to_v6().is_v4_mapped()) {
    return net::ip::make_address_v4(net::ip::v4_mapped, address.to_v6()).to_string();
  }
  if (address.is_loopback()) return address.to_string();
  std::fill(bytes.begin() + 8, bytes.end(), static_cast<unsigned char>(0));
  return net::ip::address_v6(bytes).to_string();
}

// A process may open 1024 files where nobody says otherwise, and may raise that itself.
void RaiseFileLimit(int connections) {
  rlimit limit = {};
  const rlim_t wanted = static_cast<rlim_t>(connections) + kOtherFiles;
  if (::getrlimit(RLIMIT_NOFILE, &limit) != 0 || limit.rlim_cur >= wanted) return;
  limit.rlim_cur = std::min(wanted, limit.rlim_max);
  ::setrlimit(RLIMIT_NOFILE, &limit);
}

class BeastHttpServer final : public HttpServer {
 public:
  BeastHttpServer(const HttpServerOptions& options, HttpHandler& handler)
      : core_(options, handler), acceptor_(net::make_strand(io_)), accept_timer_(acceptor_.get_executor()) {}
  ~BeastHttpServer() override { Shutdown(kDestructorGrace); }

  absl::Status Open() {
    const HttpServerOptions& options = core_.options;
    if (options.tls_certificate_file.empty() != options.tls_key_file.empty()) {
      return absl::InvalidArgumentError("a TLS certificate and its key: expected both or none");
    }
    if (!options.tls_certificate_file.empty()) {
      MW_ASSIGN_OR_RETURN(tls_, TlsFiles::Open(options.tls_certificate_file, options.tls_key_file, options.warn));
    }
    RaiseFileLimit(options.max_connections);
    MW_RETURN_IF_ERROR(Listen());
    Accept();
    for (int i = 0; i < options.io_threads; ++i) threads_.emplace_back([this] { io_.run(); });
    return absl::OkStatus();
  }

  int port() const override { return port_; }

  int connections() const override {
    const MutexLock lock(core_.mutex);
    return core_.count;
  }

  void Shutdown(absl::Duration grace) override {
    if (core_.stopping.exchange(true)) return;
    net::post(acceptor_.get_executor(), [this] {
      ErrorCode ignored;
      acceptor_.close(ignored);
      accept_timer_.cancel();
    });
    const Stopwatch since_stop;
    // Those that were being accepted are told in the next round.
    while (StopConnections() > 0 && since_stop.Elapsed() < grace)
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    io_.stop();
    for (std::thread& thread : threads_) thread.join();
    core_.pool.Shutdown();
  }

 private:
  absl::Status Listen() {
    MW_ASSIGN_OR_RETURN(const HostPort address, ParseHostPort(core_.options.listen, "the address"));
    ErrorCode error;
    Tcp::resolver resolver(io_);
    const auto found = resolver.resolve(address.host, absl::StrCat(address.port),
                                        Tcp::resolver::passive | Tcp::resolver::numeric_service, error);
    for (const auto& entry : found) {
      acceptor_.open(entry.endpoint().protocol(), error);
      // Only what lingers of a process before is shared, not the port: two servers would answer in turns.
      if (!error) acceptor_.set_option(net::socket_base::reuse_address(true), error);
      if (!error) acceptor_.bind(entry.endpoint(), error);
      if (!error) acceptor_.listen(kBacklog, error);
      if (!error) break;
      ErrorCode ignored;
      acceptor_.close(ignored);
    }
    if (error) {
      return absl::UnavailableError(absl::StrCat("cannot listen on ", core_.options.listen, ": ", error.message()));
    }
    port_ = acceptor_.local_endpoint(error).port();
    return absl::OkStatus();
  }

  void Accept() {
    acceptor_.async_accept(net::make_strand(io_), [this](ErrorCode error, Tcp::socket socket) {
      if (core_.stopping || error == net::error::operation_aborted) return;
      if (error == net::error::no_descriptors || error == net::error::no_buffer_space ||
          error == net::error::no_memory) {
        // Would fail at once again, and again.
        accept_timer_.expires_after(kAcceptAgain);
        accept_timer_.async_wait([this](ErrorCode stopped) {
          if (!stopped) Accept();
        });
        return;
      }
      if (!error) Take(std::move(socket));
      Accept();
    });
  }

  void Take(Tcp::socket socket) {
    ErrorCode error;
    const Tcp::endpoint peer = socket.remote_endpoint(error);
    if (error) return;
    socket.set_option(Tcp::no_delay(true), error);  // events are small and must not wait for each other
    std::string address = CountedAddress(peer.address());
    if (!core_.Admit(address)) return;  // closes the socket
    std::make_shared<Connection>(core_, std::move(socket), tls_ != nullptr ? tls_->Current() : nullptr,
                                 std::move(address))
        ->Start();
  }

  // Returns how many there are.
  size_t StopConnections() {
    std::vector<std::shared_ptr<Connection>> all;
    {
      const MutexLock lock(core_.mutex);
      for (const auto& [key, weak] : core_.all) {
        if (auto connection = weak.lock()) all.push_back(std::move(connection));
      }
    }
    for (const auto& connection : all) connection->Stop();
    return all.size();
  }

  mutable ServerCore core_;
  std::unique_ptr<TlsFiles> tls_;  // null: none
  int port_ = 0;
  // Destroyed first: what waits in it are connections.
  net::io_context io_;
  // While workers are at it, nothing may be left to do here.
  const net::executor_work_guard<net::io_context::executor_type> stays_ = net::make_work_guard(io_);
  Tcp::acceptor acceptor_;
  net::steady_timer accept_timer_;
  std::vector<std::thread> threads_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<HttpServer>> HttpServer::Start(const HttpServerOptions& options, HttpHandler& handler) {
  auto server = std::make_unique<BeastHttpServer>(options, handler);
  MW_RETURN_IF_ERROR(server->Open());
  return server;
}

}  // namespace meshwright
