// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <unordered_map>

#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/ssl/context.hpp>
#include <boost/asio/ssl/stream.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/beast/core/tcp_stream.hpp>

#include "common/base/clock.h"
#include "common/base/mutex.h"
#include "common/http_server/fair_worker_pool.h"
#include "common/http_server/http_message.h"
#include "common/http_server/http_server.h"
#include "common/http_server/request_parser.h"

namespace meshwright {

class Connection;

// What the connections of one server share. Outlives them.
struct ServerCore {
  ServerCore(const HttpServerOptions& server_options, HttpHandler& server_handler);

  // Counts a connection from `address`; false when there are too many.
  bool Admit(const std::string& address);
  void Leave(const std::string& address);

  const HttpServerOptions options;
  HttpHandler& handler;
  FairWorkerPool pool;
  std::atomic<bool> stopping{false};

  Mutex mutex;
  std::map<std::string, int> per_address ABSL_GUARDED_BY(mutex);
  std::unordered_map<const Connection*, std::weak_ptr<Connection>> all ABSL_GUARDED_BY(mutex);
  int count ABSL_GUARDED_BY(mutex) = 0;
};

// One client. Everything happens on the strand of its socket, but for what handlers do on worker threads; while they
// work, nothing is read or written.
class Connection : public std::enable_shared_from_this<Connection> {
 public:
  // `tls` may be null. `address` was admitted.
  Connection(ServerCore& core, boost::asio::ip::tcp::socket socket, std::shared_ptr<boost::asio::ssl::context> tls,
             std::string address);
  ~Connection();
  void Start();
  // Ends it once what it answers has been sent. Thread-safe.
  void Stop();

 private:
  using Step = void (Connection::*)();
  using ErrorCode = boost::beast::error_code;

  // Reading a head: connection.cc.
  void NextRequest();
  void ReadHead();
  void TakeHead(size_t bytes);
  std::string CallerOf(const HttpRequest& request) const;

  // The handler, and the request's body: connection_body.cc.
  void Handled();
  void BeginBody();
  void ReadBody();
  void ReadIntoBody(Step then);
  bool DecodeBody();
  bool BodyHasEnded() const;
  void TakePiece();
  void PieceTaken();
  void DropBody();
  void EndBody();

  // The answer: connection_response.cc.
  void Fault(const HttpFault& fault);
  void Respond();
  std::string ResponseHead();
  void WriteBody();
  void WritePiece();
  void PieceRead();
  void WatchClient();
  void PumpEvents();
  void EventsWritten();
  void AfterResponse();
  void Linger();

  // What the steps are made of. Each calls `then` on the strand, unless the client is gone or too slow.
  void Read(size_t most, Step then);
  void Write(std::string text, Step then);
  void WriteRest(Step then);
  void InWorker(std::function<void()> work, Step then);
  void Expire(absl::Duration after);
  void Reset();
  void Close();

  template <typename Buffer, typename Handler>
  void ReadSome(const Buffer& buffer, Handler handler);

  ServerCore& core_;
  const std::string address_;
  boost::beast::tcp_stream tcp_;
  std::shared_ptr<boost::asio::ssl::context> tls_context_;
  std::optional<boost::asio::ssl::stream<boost::beast::tcp_stream&>> tls_;
  boost::asio::steady_timer timer_;  // the next heartbeat

  std::string in_;  // read, not yet used
  size_t scanned_ = 0;
  std::unique_ptr<HttpExchange> exchange_;
  std::unique_ptr<RequestParser> parser_;
  bool waits_ = false;  // for the next request
  bool keep_alive_ = false;
  bool closed_ = false;

  std::unique_ptr<char[]> body_;  // decoded, not yet taken
  size_t body_bytes_ = 0;         // in body_
  int64_t content_left_ = 0;      // of Content-Length, not yet in body_
  int64_t received_ = 0;
  int64_t dropped_ = 0;
  Stopwatch body_time_;    // since the body began
  bool dropping_ = false;  // what comes is not wanted any more
  bool more_wanted_ = true;

  std::string out_;
  size_t written_ = 0;
  int64_t piece_offset_ = 0;
  absl::StatusOr<std::string> piece_;
  bool writes_events_ = false;
  char watched_[512];
  size_t drained_ = 0;
};

template <typename Buffer, typename Handler>
void Connection::ReadSome(const Buffer& buffer, Handler handler) {
  if (tls_) {
    tls_->async_read_some(buffer, std::move(handler));
  } else {
    tcp_.async_read_some(buffer, std::move(handler));
  }
}

}  // namespace meshwright
