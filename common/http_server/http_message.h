// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <absl/status/statusor.h>
#include <absl/types/span.h>

namespace meshwright {

// Header fields in the order in which they came. Names are compared without case.
class HttpHeaders {
 public:
  void Add(std::string name, std::string value);
  // Replaces what there is under this name.
  void Set(std::string name, std::string value);
  bool Has(const std::string& name) const { return Count(name) > 0; }
  size_t Count(const std::string& name) const;
  // The first one; "" when there is none.
  std::string Get(const std::string& name) const;
  const std::vector<std::pair<std::string, std::string>>& all() const { return fields_; }

 private:
  std::vector<std::pair<std::string, std::string>> fields_;
};

// The head of a request. Its body goes to an HttpBodySink.
struct HttpRequest {
  std::string method;
  std::string path;                                // percent-decoded, without the query
  std::multimap<std::string, std::string> params;  // of the query, decoded
  HttpHeaders headers;
  bool has_body = false;
  // The address of who asks: the peer's or, when that is a trusted proxy, what it says in X-Forwarded-For.
  std::string caller;
  bool is_tls = false;  // as it came to this server

  bool HasParam(const std::string& name) const { return params.count(name) > 0; }
  // The first one; "" when there is none.
  std::string Param(const std::string& name) const;
};

// Fills in path and params. False unless `target` is a path, or an address with one (RFC 9112, section 3.2).
bool ParseTarget(const std::string& target, HttpRequest& request);

// A body without a known end that is written as it comes to be, e.g. server-sent events. Nothing is queued: the server
// asks for more when the client has taken what there was.
class HttpEventSource {
 public:
  virtual ~HttpEventSource() = default;
  // What there is now, "" when there is nothing; nullopt at the end. Called on an io thread: must not block.
  virtual std::optional<std::string> Next() = 0;
  // What is sent when there has been nothing for a while, so that the connection is not taken for dead.
  virtual std::string Heartbeat() = 0;
  // Called once, before the first Next(). `wake` may be called from any thread, until the source is destroyed, when
  // Next() has something new.
  virtual void SetWake(std::function<void()> wake) = 0;
};

// An answer: status, headers and one of three kinds of bodies.
struct HttpResponse {
  // Up to `most` bytes from `offset` on, at least one. An error ends the connection. Called on worker threads.
  using Pieces = std::function<absl::StatusOr<std::string>(int64_t offset, size_t most)>;

  int status = 200;
  HttpHeaders headers;
  std::string content;
  int64_t piece_bytes = 0;  // that `pieces` gives in all
  Pieces pieces;
  std::unique_ptr<HttpEventSource> events;

  void SetContent(std::string bytes, const std::string& content_type);
  void SetPieces(int64_t size_bytes, const std::string& content_type, Pieces read);
  void SetEvents(const std::string& content_type, std::unique_ptr<HttpEventSource> source);
};

struct HttpExchange;

// What takes a request's body. Called on worker threads, one call at a time; a client that sends slowly holds none.
class HttpBodySink {
 public:
  virtual ~HttpBodySink() = default;
  // Longer bodies are answered with 413.
  virtual int64_t max_bytes() const = 0;
  // False: no more is wanted, Finish() has the reason.
  virtual bool Take(absl::Span<const uint8_t> bytes) = 0;
  // After the last piece, or after Take() was false: fills in the answer. Not called when the body ends early.
  virtual void Finish(HttpExchange& exchange) = 0;
};

// One request with its answer.
struct HttpExchange {
  HttpRequest request;
  HttpResponse response;
  // Set by a handler that wants the body; the answer is then given by Finish(). A body that no handler wants is read
  // and dropped, or the connection is closed: it is never taken for the next request.
  std::unique_ptr<HttpBodySink> body;
};

// Why the server itself cannot serve a request.
struct HttpFault {
  int status = 400;
  std::string field;   // the header that is to blame; "": none
  std::string detail;  // one line; "": the status says all
};

// What a server answers with.
class HttpHandler {
 public:
  virtual ~HttpHandler() = default;
  // Whether Handle() does not block: it is then called on an io thread and waits for no worker.
  virtual bool IsQuick(const HttpRequest& request) const { return false; }
  // Fills in the response or sets the body's sink. Called on a worker thread.
  virtual void Handle(HttpExchange& exchange) = 0;
  // The answer to a fault. On an io thread: must not block.
  virtual void AnswerFault(const HttpFault& fault, HttpResponse& response) = 0;
};

}  // namespace meshwright
