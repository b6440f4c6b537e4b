// SPDX-License-Identifier: Apache-2.0
#include "common/http_server/connection.h"

#include <algorithm>
#include <exception>
#include <utility>
#include <vector>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_split.h>
#include <absl/strings/strip.h>
#include <boost/asio/dispatch.hpp>
#include <boost/asio/post.hpp>

namespace meshwright {
namespace {

namespace net = boost::asio;

constexpr size_t kHeadPieceBytes = 4096;
constexpr size_t kMaxWaitingTasks = 8192;

}  // namespace

ServerCore::ServerCore(const HttpServerOptions& server_options, HttpHandler& server_handler)
    : options(server_options), handler(server_handler), pool(server_options.worker_threads, kMaxWaitingTasks) {}

bool ServerCore::Admit(const std::string& address) {
  const MutexLock lock(mutex);
  int& here = per_address[address];
  const bool shares = options.trusted_proxies.count(address) == 0;
  if (count >= options.max_connections || (shares && here >= options.max_connections_per_address)) {
    if (here == 0) per_address.erase(address);
    return false;
  }
  ++here;
  ++count;
  return true;
}

void ServerCore::Leave(const std::string& address) {
  const MutexLock lock(mutex);
  --count;
  const auto found = per_address.find(address);
  if (--found->second == 0) per_address.erase(found);
}

Connection::Connection(ServerCore& core, net::ip::tcp::socket socket, std::shared_ptr<net::ssl::context> tls,
                       std::string address)
    : core_(core),
      address_(std::move(address)),
      tcp_(std::move(socket)),
      tls_context_(std::move(tls)),
      timer_(tcp_.get_executor()) {
  if (tls_context_ != nullptr) tls_.emplace(tcp_, *tls_context_);
}

Connection::~Connection() {
  {
    const MutexLock lock(core_.mutex);
    core_.all.erase(this);
  }
  core_.Leave(address_);
}

void Connection::Start() {
  {
    const MutexLock lock(core_.mutex);
    core_.all[this] = weak_from_this();
  }
  net::dispatch(tcp_.get_executor(), [self = shared_from_this()] {
    self->waits_ = true;
    self->Expire(self->core_.options.head_timeout);
    if (!self->tls_) return self->ReadHead();
    self->tls_->async_handshake(net::ssl::stream_base::server, [self](ErrorCode error) {
      if (error) return self->Close();
      self->ReadHead();
    });
  });
}

void Connection::Stop() {
  net::post(tcp_.get_executor(), [self = shared_from_this()] {
    self->keep_alive_ = false;
    if (self->waits_) self->Close();
  });
}

void Connection::Expire(absl::Duration after) { tcp_.expires_after(absl::ToChronoNanoseconds(after)); }

void Connection::Read(size_t most, Step then) {
  const size_t before = in_.size();
  in_.resize(before + most);
  ReadSome(net::buffer(&in_[before], most), [self = shared_from_this(), before, then](ErrorCode error, size_t count) {
    self->in_.resize(before + count);
    if (error) {
      if (error == net::error::eof && self->exchange_ != nullptr) {
        return self->Fault({400, "", "the body ended early"});
      }
      return self->Close();
    }
    (self.get()->*then)();
  });
}

void Connection::Write(std::string text, Step then) {
  out_ = std::move(text);
  written_ = 0;
  WriteRest(then);
}

void Connection::WriteRest(Step then) {
  if (written_ == out_.size()) {
    out_ = std::string();
    return (this->*then)();
  }
  Expire(core_.options.idle_timeout);
  const auto buffer = net::buffer(&out_[written_], out_.size() - written_);
  auto handler = [self = shared_from_this(), then](ErrorCode error, size_t count) {
    if (error) return self->Reset();
    self->written_ += count;
    self->WriteRest(then);
  };
  if (tls_) {
    tls_->async_write_some(buffer, std::move(handler));
  } else {
    tcp_.async_write_some(buffer, std::move(handler));
  }
}

void Connection::InWorker(std::function<void()> work, Step then) {
  const bool taken =
      core_.pool.Submit(exchange_->request.caller, [self = shared_from_this(), work = std::move(work), then]() mutable {
        Step next = then;
        try {
          work();
        } catch (const std::exception& exception) {
          // One request's failure, not the server's.
          self->core_.options.warn(absl::StrCat("a request failed with an exception: ", exception.what()));
          next = nullptr;
        }
        work = nullptr;
        net::post(self->tcp_.get_executor(), [self, next] {
          if (next == nullptr) return self->Fault({500, "", "the request could not be answered"});
          (self.get()->*next)();
        });
      });
  if (!taken) Fault({503, "", "too many requests wait, try again later"});
}

void Connection::NextRequest() {
  exchange_.reset();
  parser_.reset();
  body_.reset();
  if (core_.stopping) return Close();
  scanned_ = 0;
  waits_ = in_.empty();
  if (waits_) in_ = std::string();
  Expire(waits_ ? core_.options.keep_alive_timeout : core_.options.head_timeout);
  ReadHead();
}

void Connection::ReadHead() {
  if (waits_ && !in_.empty()) {
    waits_ = false;
    Expire(core_.options.head_timeout);
  }
  const size_t end = in_.find("\r\n\r\n", scanned_ - std::min<size_t>(scanned_, 3));
  scanned_ = in_.size();
  const HttpServerOptions& options = core_.options;
  const bool too_long = (end == std::string::npos ? in_.size() : end) > options.max_head_bytes;
  if (end != std::string::npos && !too_long) return TakeHead(end + 4);
  if (in_.find("\r\n") > options.max_start_line_bytes && in_.size() > options.max_start_line_bytes) {
    return Fault({414, "", ""});
  }
  if (too_long) {
    return Fault({431, "", absl::StrCat("the head has more than ", options.max_head_bytes, " bytes")});
  }
  Read(kHeadPieceBytes, &Connection::ReadHead);
}

std::string Connection::CallerOf(const HttpRequest& request) const {
  const std::set<std::string>& proxies = core_.options.trusted_proxies;
  if (proxies.count(address_) == 0) return address_;
  // Each proxy adds whom it heard it from; what comes before the last one that is known can be invented.
  std::string caller = address_;
  const std::string forwarded = request.headers.Get("X-Forwarded-For");
  const std::vector<std::string> addresses = absl::StrSplit(forwarded, ',', absl::SkipWhitespace());
  for (auto it = addresses.rbegin(); it != addresses.rend() && proxies.count(caller) > 0; ++it) {
    caller = std::string(absl::StripAsciiWhitespace(*it));
  }
  return caller;
}

void Connection::TakeHead(size_t bytes) {
  const std::string head = in_.substr(0, bytes);
  in_.erase(0, bytes);
  waits_ = false;
  exchange_ = std::make_unique<HttpExchange>();
  parser_ = std::make_unique<RequestParser>();
  HttpRequest& request = exchange_->request;
  const HttpServerOptions& options = core_.options;
  const auto fault = parser_->ParseHead(
      head, {.max_start_line_bytes = options.max_start_line_bytes, .max_fields = options.max_header_fields}, request);
  request.caller = CallerOf(request);
  request.is_tls = tls_context_ != nullptr;
  if (fault) return Fault(*fault);
  if (request.has_body && (request.method == "GET" || request.method == "HEAD")) {
    return Fault({400, "", absl::StrCat("the body is there, expected none with ", request.method)});
  }
  keep_alive_ = parser_->keeps_alive() && !core_.stopping;
  if (core_.handler.IsQuick(request)) {
    core_.handler.Handle(*exchange_);
    return Handled();
  }
  InWorker([this] { core_.handler.Handle(*exchange_); }, &Connection::Handled);
}

void Connection::Reset() {
  // What the client does not take would otherwise stay with the kernel, megabytes for minutes.
  ErrorCode ignored;
  tcp_.socket().set_option(net::socket_base::linger(true, 0), ignored);
  Close();
}

void Connection::Close() {
  if (std::exchange(closed_, true)) return;
  timer_.cancel();
  tcp_.close();
  // Gives back what it stands for, e.g. a stream's place, though somebody may hold the connection a little longer.
  if (exchange_ != nullptr) exchange_->response.events.reset();
}

}  // namespace meshwright
