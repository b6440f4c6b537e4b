// SPDX-License-Identifier: Apache-2.0
// The answer to a request: its head, its body, whole, in pieces or as a stream of events, and what comes after it.
#include <algorithm>
#include <optional>
#include <utility>

#include <absl/strings/str_cat.h>
#include <boost/asio/post.hpp>
#include <boost/beast/http/status.hpp>

#include "common/http_server/connection.h"

namespace meshwright {
namespace {

namespace net = boost::asio;

constexpr size_t kAnswerPieceBytes = size_t{256} << 10;
constexpr size_t kJoinedBytes = size_t{16} << 10;  // answers up to this size are written together with their head
constexpr size_t kMaxDrainedBytes = size_t{1} << 20;
constexpr absl::Duration kLinger = absl::Seconds(2);

// A header field is one line, whatever it was made of.
std::string OneLine(std::string value) {
  for (char& c : value) {
    if (c == '\r' || c == '\n' || c == '\0') c = '?';
  }
  return value;
}

std::string Chunk(const std::string& text) { return absl::StrCat(absl::Hex(text.size()), "\r\n", text, "\r\n"); }

}  // namespace

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

}  // namespace meshwright
