// SPDX-License-Identifier: Apache-2.0
// The body of a request: it is read in pieces, each of which its sink takes on a worker thread before the next is read.
#include <algorithm>
#include <cstring>

#include <absl/strings/str_cat.h>
#include <absl/types/span.h>

#include "common/http_server/connection.h"

namespace meshwright {
namespace {

constexpr size_t kChunkedPieceBytes = size_t{16} << 10;
constexpr size_t kBodyPieceBytes = size_t{128} << 10;  // that a sink gets at a time
// So much of a body that nobody wants is read, so that the client hears why; beyond it the connection is closed.
constexpr int64_t kMaxDroppedBytes = int64_t{4} << 20;

}  // namespace

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
  body_time_ = Stopwatch();
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

void Connection::ReadIntoBody(Step then) {
  const size_t most =
      static_cast<size_t>(std::min<int64_t>(static_cast<int64_t>(kBodyPieceBytes - body_bytes_), content_left_));
  ReadSome(boost::asio::buffer(&body_[body_bytes_], most),
           [self = shared_from_this(), then](ErrorCode error, size_t count) {
             if (error == boost::asio::error::eof) return self->Fault({400, "", "the body ended early"});
             if (error) return self->Close();
             self->body_bytes_ += count;
             self->content_left_ -= static_cast<int64_t>(count);
             self->received_ += static_cast<int64_t>(count);
             (self.get()->*then)();
           });
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
      body_time_.Elapsed();
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

}  // namespace meshwright
