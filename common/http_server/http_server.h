// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>
#include <set>
#include <string>

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <absl/time/time.h>

#include "common/http_server/http_message.h"

namespace meshwright {

struct HttpServerOptions {
  std::string listen;                // "host:port"; port 0 takes a free one
  std::string tls_certificate_file;  // PEM, the whole chain; read again when it changes. "": no TLS
  std::string tls_key_file;          // PEM
  // Addresses whose X-Forwarded-For is believed, and which are not held to one address's share of the connections.
  std::set<std::string> trusted_proxies;
  int io_threads = 2;
  int worker_threads = 4;  // for handlers; one caller gets half of them at most
  int max_connections = 4096;
  int max_connections_per_address = 1024;  // IPv6: per /64
  size_t max_start_line_bytes = 8192;
  size_t max_head_bytes = 16384;  // start line and header fields
  int max_header_fields = 100;
  absl::Duration head_timeout = absl::Seconds(10);  // for all of a request's head
  // For each step forward of a body and of an answer.
  absl::Duration idle_timeout = absl::Seconds(10);
  // A body also has to come at this rate on average, after its first idle_timeout.
  int64_t min_body_bytes_per_second = 1024;
  // Between requests. Not shorter than what proxies keep idle connections for (nginx: 60 s), or they send a request
  // into a connection that is being closed.
  absl::Duration keep_alive_timeout = absl::Seconds(75);
  absl::Duration event_heartbeat = absl::Seconds(15);
  // Told in one line what goes on unnoticed otherwise: a certificate that cannot be read, a handler's exception.
  std::function<void(const std::string&)> warn = [](const std::string&) {};
};

// An HTTP/1.1 server for the open: few threads whatever the number of connections, and a bound and a deadline for
// everything that a client sends. Requests that can be understood in two ways (RFC 9112, sections 5.2, 6.1 and 11.2)
// get 400, and their connection is closed. docs/adr/0011 says why it is made of Boost.Beast.
class HttpServer {
 public:
  // `handler` outlives the server. InvalidArgument names the file or the address; Unavailable when the port is taken.
  static absl::StatusOr<std::unique_ptr<HttpServer>> Start(const HttpServerOptions& options, HttpHandler& handler);
  // Shuts down.
  virtual ~HttpServer() = default;
  virtual int port() const = 0;
  virtual int connections() const = 0;
  // Takes nothing new, answers what waits for at most `grace`, closes everything.
  virtual void Shutdown(absl::Duration grace) = 0;
};

}  // namespace meshwright
