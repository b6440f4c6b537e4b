#include "common/http_server/connection.h"

#include <algorithm>
#include <cstring>
#include <exception>
#include <utility>
#include <vector>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_split.h>
#include <absl/strings/strip.h>
#include <boost/asio/dispatch.hpp>
#include <boost/asio/post.hpp>
#include <boost/beast/http/status.hpp>

namespace meshwright {
namespace {

namespace net = boost::asio;

constexpr size_t kHeadPieceBytes = 4096;
constexpr size_t kChunkedPieceBytes = size_t{16} << 10;
constexpr size_t kBodyPieceBytes = size_t{128} << 10;  // that a sink gets at a time
constexpr size_t kAnswerPieceBytes = size_t{256} << 10;
constexpr size_t kJoinedBytes = size_t{16} << 10;  // answers up to this size are written together with their head
// So much of a body that nobody wants is read, so that the client hears why; beyond it the connection is closed.
constexpr int64_t kMaxDroppedBytes = int64_t{4} << 20;
constexpr size_t kMaxDrainedBytes = size_t{1} << 20;
constexpr absl::Duration kLinger = absl::Seconds(2);
constexpr size_t kMaxWaitingTasks = 8192;

// A header field is one line, whatever it was made of.
std::string OneLine(std::string value) {
  for (char& c : value) {
    if (c == '\r' || c == '\n' || c == '\0') c = '?';
  }
  return value;
}

std::string Chunk(const std::string& text) { return absl::StrCat(absl::Hex(text.size()), "\r\n", text, "\r\n"); }

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

template <typename Buffer, typename Handler>
void Connection::ReadSome(const Buffer& buffer, Handler handler) {
  if (tls_) {
    tls_->async_read_some(buffer, std::move(handler));
  } else {
    tcp_.async_read_some(buffer, std::move(handler));
  }
}

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

void Connection::ReadIntoBody(Step then) {
  const size_t most =
      static_cast<size_t>(std::min<int64_t>(static_cast<int64_t>(kBodyPieceBytes - body_bytes_), content_left_));
  ReadSome(net::buffer(&body_[body_bytes_], most), [self = shared_from_this(), then](ErrorCode error, size_t count) {
    if (error == net::error::eof) return self->Fault({400, "", "the body ended early"});
    if (error) return self->Close();
    self->body_bytes_ += count;
    self->content_left_ -= static_cast<int64_t>(count);
    self->received_ += static_cast<int64_t>(count);
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

void Connection::Handled() {
  const bool asks_first = exchange_->request.headers.Has("Expect");
  if (!exchange_->request.has_body) {
    if (exchange_->body == nullptr) return Respond();
    return InWorker([this] { exchange_->body->Finish(*exchange_); }, &Connection::Respond);
  }
  content_left_ = parser_->content_bytes();
  received_ = dropped_ = 0;
  body_bytes_ = 0;
  more_wanted_ = true;
  body_began_ = absl::Now();
  if (exchange_->body == nullptr) {
    // Whoever asks first need not send what is not wanted, and nobody knows whether it will.
    if (asks_first) keep_alive_ = false;
    return asks_first ? Respond() : DropBody();
  }
  if (content_left_ > exchange_->body->max_bytes() + (asks_first ? 0 : kMaxDroppedBytes)) {
    return Fault({413, "", absl::StrCat("the body has more than ", exchange_->body->max_bytes(), " bytes")});
  }
  if (asks_first) return Write("HTTP/1.1 100 Continue\r\n\r\n", &Connection::BeginBody);
  BeginBody();
}

void Connection::BeginBody() {
  dropping_ = false;
  body_.reset(new char[kBodyPieceBytes]);
  ReadBody();
}

bool Connection::BodyHasEnded() const {
  return parser_->has_chunked_body() ? parser_->has_ended() : content_left_ == 0;
}

// Moves what was read into the body. False: it is malformed.
bool Connection::DecodeBody() {
  const absl::Span<char> room(&body_[body_bytes_], kBodyPieceBytes - body_bytes_);
  size_t used = 0;
  size_t decoded = 0;
  bool good = true;
  if (parser_->has_chunked_body()) {
    good = parser_->DecodeChunked(in_, room, &used, &decoded);
    // The line of a chunk's size and the fields behind the last one are no longer than a head.
    good = good && (decoded > 0 || in_.size() - used <= core_.options.max_head_bytes);
  } else {
    used = decoded =
        static_cast<size_t>(std::min<int64_t>(static_cast<int64_t>(std::min(in_.size(), room.size())), content_left_));
    std::memcpy(room.data(), in_.data(), used);
    content_left_ -= static_cast<int64_t>(used);
  }
  in_.erase(0, used);
  body_bytes_ += decoded;
  received_ += static_cast<int64_t>(decoded);
  return good;
}

void Connection::ReadBody() {
  if (!in_.empty() && body_bytes_ < kBodyPieceBytes && !BodyHasEnded() && !DecodeBody()) {
    return Fault({400, "", "the chunks of the body cannot be understood"});
  }
  if (exchange_->body != nullptr && received_ > exchange_->body->max_bytes()) {
    const int64_t most = exchange_->body->max_bytes();
    exchange_->body.reset();
    exchange_->response = {};
    core_.handler.AnswerFault({413, "", absl::StrCat("the body has more than ", most, " bytes")}, exchange_->response);
    dropping_ = true;
  }
  if (dropping_) {
    dropped_ += static_cast<int64_t>(body_bytes_);
    body_bytes_ = 0;
    if (BodyHasEnded()) return EndBody();
    if (dropped_ + content_left_ > kMaxDroppedBytes) {
      keep_alive_ = false;
      return EndBody();
    }
  }
  if (BodyHasEnded() || body_bytes_ == kBodyPieceBytes) return TakePiece();
  const HttpServerOptions& options = core_.options;
  const absl::Duration by_rate =
      options.idle_timeout +
      absl::Seconds(static_cast<double>(received_) / static_cast<double>(options.min_body_bytes_per_second)) -
      (absl::Now() - body_began_);
  Expire(std::max(absl::ZeroDuration(), std::min(options.idle_timeout, by_rate)));
  if (parser_->has_chunked_body()) {
    Read(kChunkedPieceBytes, &Connection::ReadBody);
  } else {
    ReadIntoBody(&Connection::ReadBody);
  }
}

void Connection::TakePiece() {
  InWorker(
      [this] {
        const auto* bytes = reinterpret_cast<const uint8_t*>(body_.get());
        more_wanted_ = exchange_->body->Take(absl::MakeConstSpan(bytes, body_bytes_));
        // What ends with this piece is answered in the same go.
        if (BodyHasEnded()) exchange_->body->Finish(*exchange_);
      },
      &Connection::PieceTaken);
}

void Connection::PieceTaken() {
  body_bytes_ = 0;
  if (BodyHasEnded()) return Respond();
  dropping_ = !more_wanted_;
  ReadBody();
}

void Connection::DropBody() {
  dropping_ = true;
  body_.reset(new char[kBodyPieceBytes]);
  ReadBody();
}

// Of what was dropped.
void Connection::EndBody() {
  if (exchange_->body == nullptr) return Respond();
  InWorker([this] { exchange_->body->Finish(*exchange_); }, &Connection::Respond);
}

void Connection::Fault(const HttpFault& fault) {
  if (closed_) return;
  if (exchange_ == nullptr) exchange_ = std::make_unique<HttpExchange>();
  exchange_->body.reset();
  exchange_->response = {};
  core_.handler.AnswerFault(fault, exchange_->response);
  keep_alive_ = false;
  Respond();
}

std::string Connection::ResponseHead() {
  const HttpResponse& response = exchange_->response;
  const bool http_1_0 = parser_ != nullptr && parser_->is_http_1_0();
  const boost::beast::string_view reason =
      boost::beast::http::obsolete_reason(static_cast<boost::beast::http::status>(response.status));
  std::string head = absl::StrCat("HTTP/1.1 ", response.status, " ", std::string(reason.data(), reason.size()), "\r\n");
  for (const auto& [name, value] : response.headers.all()) absl::StrAppend(&head, name, ": ", OneLine(value), "\r\n");
  if (response.events != nullptr) {
    if (!http_1_0) absl::StrAppend(&head, "Transfer-Encoding: chunked\r\n");
  } else if (response.status != 204 && response.status != 304) {
    const int64_t bytes = response.pieces ? response.piece_bytes : static_cast<int64_t>(response.content.size());
    absl::StrAppend(&head, "Content-Length: ", bytes, "\r\n");
  }
  if (!keep_alive_) {
    absl::StrAppend(&head, "Connection: close\r\n");
  } else if (http_1_0) {
    absl::StrAppend(&head, "Connection: keep-alive\r\n");
  }
  return head + "\r\n";
}

void Connection::Respond() {
  HttpResponse& response = exchange_->response;
  body_.reset();
  exchange_->body.reset();
  // A stream is watched for the client's end, so that no other request can be read behind it.
  if (response.events != nullptr || core_.stopping) keep_alive_ = false;
  std::string text = ResponseHead();
  const bool without_body = exchange_->request.method == "HEAD" || response.status == 204 || response.status == 304;
  if (without_body) return Write(std::move(text), &Connection::AfterResponse);
  if (response.events == nullptr && !response.pieces && response.content.size() <= kJoinedBytes) {
    text += response.content;
    return Write(std::move(text), &Connection::AfterResponse);
  }
  Write(std::move(text), &Connection::WriteBody);
}

void Connection::WriteBody() {
  HttpResponse& response = exchange_->response;
  if (response.events != nullptr) {
    response.events->SetWake([weak = weak_from_this(), executor = tcp_.get_executor()] {
      net::post(executor, [weak] {
        if (const auto self = weak.lock()) self->PumpEvents();
      });
    });
    WatchClient();
    return PumpEvents();
  }
  if (!response.pieces) return Write(std::move(response.content), &Connection::AfterResponse);
  piece_offset_ = 0;
  WritePiece();
}

void Connection::WritePiece() {
  if (piece_offset_ == exchange_->response.piece_bytes) return AfterResponse();
  InWorker(
      [this] {
        const int64_t left = exchange_->response.piece_bytes - piece_offset_;
        piece_ = exchange_->response.pieces(
            piece_offset_, static_cast<size_t>(std::min<int64_t>(left, static_cast<int64_t>(kAnswerPieceBytes))));
      },
      &Connection::PieceRead);
}

void Connection::PieceRead() {
  // The client sees that it ends too early.
  if (!piece_.ok() || piece_->empty()) return Close();
  piece_offset_ += static_cast<int64_t>(piece_->size());
  Write(*std::move(piece_), &Connection::WritePiece);
}

void Connection::WatchClient() {
  tcp_.expires_never();
  ReadSome(net::buffer(watched_), [self = shared_from_this()](ErrorCode error, size_t count) {
    if (error) return self->Close();
    // Whatever it says now is not heard any more.
    self->drained_ += count;
    if (self->drained_ > kMaxDrainedBytes) return self->Close();
    self->WatchClient();
  });
}

void Connection::PumpEvents() {
  if (closed_ || writes_events_) return;
  const std::optional<std::string> text = exchange_->response.events->Next();
  const bool chunked = !parser_->is_http_1_0();
  if (!text) {
    writes_events_ = true;  // nothing comes behind the end
    timer_.cancel();
    return Write(chunked ? "0\r\n\r\n" : "", &Connection::AfterResponse);
  }
  if (!text->empty()) {
    writes_events_ = true;
    return Write(chunked ? Chunk(*text) : *text, &Connection::EventsWritten);
  }
  // Waiting again ends the wait of before.
  timer_.expires_after(absl::ToChronoNanoseconds(core_.options.event_heartbeat));
  timer_.async_wait([self = shared_from_this(), chunked](ErrorCode error) {
    if (error || self->closed_ || self->writes_events_) return;
    self->writes_events_ = true;
    const std::string heartbeat = self->exchange_->response.events->Heartbeat();
    self->Write(chunked ? Chunk(heartbeat) : heartbeat, &Connection::EventsWritten);
  });
}

void Connection::EventsWritten() {
  writes_events_ = false;
  PumpEvents();
}

void Connection::AfterResponse() {
  if (keep_alive_) return NextRequest();
  if (exchange_->response.events != nullptr && !tls_) {
    ErrorCode ignored;
    tcp_.socket().shutdown(net::ip::tcp::socket::shutdown_send, ignored);
    return Close();
  }
  drained_ = 0;
  Expire(kLinger);
  if (tls_) {
    return tls_->async_shutdown([self = shared_from_this()](ErrorCode) { self->Close(); });
  }
  ErrorCode error;
  tcp_.socket().shutdown(net::ip::tcp::socket::shutdown_send, error);
  if (error) return Close();
  Linger();
}

// Closing what still sends would make the client's system drop the answer before it was read.
void Connection::Linger() {
  drained_ += in_.size();
  in_.clear();
  if (drained_ > kMaxDrainedBytes) return Close();
  ReadSome(net::buffer(watched_), [self = shared_from_this()](ErrorCode error, size_t count) {
    if (error) return self->Close();
    self->drained_ += count;
    self->Linger();
  });
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
// SPDX-License-Identifier: Apache-2.0
