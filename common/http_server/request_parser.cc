// SPDX-License-Identifier: Apache-2.0
#include "common/http_server/request_parser.h"

#include <algorithm>
#include <array>
#include <cstring>

#include <absl/strings/match.h>
#include <absl/strings/numbers.h>
#include <absl/strings/str_cat.h>

namespace meshwright {
namespace {

namespace http = boost::beast::http;

constexpr size_t kQuoted = 64;
constexpr size_t kMaxHeadBytes = size_t{1} << 20;  // the server's limit is below

// What two readers of the same bytes could divide differently: lines that go on in the next one.
std::optional<HttpFault> CheckLines(const std::string& head, const HeadLimits& limits) {
  int lines = 0;
  for (size_t begin = 0; begin < head.size(); ++lines) {
    const size_t end = head.find("\r\n", begin);
    if (lines == 0 && end > limits.max_start_line_bytes) return HttpFault{414, "", ""};
    if (lines > 0 && (head[begin] == ' ' || head[begin] == '\t')) {
      return HttpFault{400, "", "a header field goes on in the next line, expected one line each"};
    }
    begin = end + 2;
  }
  const int fields = lines - 2;  // without the start line and the empty line
  if (fields <= limits.max_fields) return std::nullopt;
  return HttpFault{431, "",
                   absl::StrCat("the request has ", fields, " header fields, expected at most ", limits.max_fields)};
}

bool IsKnownMethod(const std::string& method) {
  static constexpr std::array<const char*, 9> kMethods = {"GET",     "HEAD",    "POST",  "PUT",  "DELETE",
                                                          "CONNECT", "OPTIONS", "TRACE", "PATCH"};
  return std::find(kMethods.begin(), kMethods.end(), method) != kMethods.end();
}

std::optional<HttpFault> CheckContentLength(const HttpHeaders& headers, int64_t* length) {
  const size_t count = headers.Count("Content-Length");
  if (count == 0) return std::nullopt;
  const std::string text = headers.Get("Content-Length");
  const bool digits = !text.empty() && text.find_first_not_of("0123456789") == std::string::npos;
  if (count > 1) return HttpFault{400, "Content-Length", "Content-Length is given twice, expected once"};
  if (digits && absl::SimpleAtoi(text, length)) return std::nullopt;
  return HttpFault{400, "Content-Length",
                   absl::StrCat("Content-Length is \"", text.substr(0, kQuoted), "\", expected a whole number")};
}

// Where the body ends.
struct Framing {
  bool is_chunked = false;
  int64_t length = 0;  // of a body that is not
};

// What the header fields say, whatever Beast makes of them.
std::optional<HttpFault> CheckFraming(const HttpHeaders& headers, bool http_1_0, Framing& framing) {
  if (const auto fault = CheckContentLength(headers, &framing.length)) return fault;
  const std::string encoding = headers.Get("Transfer-Encoding");
  framing.is_chunked = headers.Has("Transfer-Encoding");
  if (framing.is_chunked) {
    if (headers.Has("Content-Length")) {
      return HttpFault{400, "Transfer-Encoding",
                       "Transfer-Encoding and Content-Length are given, expected one of them"};
    }
    if (http_1_0 || headers.Count("Transfer-Encoding") > 1) {
      return HttpFault{400, "Transfer-Encoding", "Transfer-Encoding is there, expected once and with HTTP/1.1"};
    }
    if (!absl::EqualsIgnoreCase(encoding, "chunked")) {
      return HttpFault{
          501, "Transfer-Encoding",
          absl::StrCat("Transfer-Encoding is \"", encoding.substr(0, kQuoted), "\", expected chunked alone")};
    }
  }
  const size_t hosts = headers.Count("Host");
  if (hosts > 1 || (hosts == 0 && !http_1_0)) return HttpFault{400, "Host", "Host is expected once"};
  return std::nullopt;
}

}  // namespace

void RequestParser::on_request_impl(Verb, Text method, Text target, int version, ErrorCode&) {
  request_->method = std::string(method.data(), method.size());
  target_ = std::string(target.data(), target.size());
  version_ = version;
}

void RequestParser::on_field_impl(http::field, Text name, Text value, ErrorCode&) {
  // Fields behind a chunked body say nothing here.
  if (request_ == nullptr) return;
  request_->headers.Add(std::string(name.data(), name.size()), std::string(value.data(), value.size()));
}

std::size_t RequestParser::on_chunk_body_impl(std::uint64_t, Text body, ErrorCode&) {
  const size_t count = std::min(body.size(), decoded_.size());
  std::memcpy(decoded_.data(), body.data(), count);
  decoded_.remove_prefix(count);
  return count;
}

std::optional<HttpFault> RequestParser::ParseHead(const std::string& head, const HeadLimits& limits,
                                                  HttpRequest& request) {
  if (auto fault = CheckLines(head, limits)) return fault;
  header_limit(kMaxHeadBytes);
  body_limit(boost::none);
  request_ = &request;
  ErrorCode error;
  put(boost::asio::buffer(head), error);
  request_ = nullptr;
  // What is wrong with the fields that frame the body is better said here than by Beast.
  Framing framing;
  auto fault = CheckFraming(request.headers, version_ == 10, framing);
  if (fault && !request.method.empty()) return fault;
  chunked_body_ = framing.is_chunked;
  content_bytes_ = framing.length;
  if (error == http::error::bad_content_length || error == http::error::multiple_content_length) {
    return HttpFault{400, "Content-Length", "Content-Length is expected once, a whole number"};
  }
  if (error == http::error::bad_transfer_encoding) {
    return HttpFault{400, "Transfer-Encoding", "Transfer-Encoding is expected once, and without Content-Length"};
  }
  if (error || !is_header_done()) return HttpFault{400, "", ""};
  return CheckHead(request);
}

std::optional<HttpFault> RequestParser::CheckHead(HttpRequest& request) {
  if (!IsKnownMethod(request.method) || !ParseTarget(target_, request)) return HttpFault{400, "", ""};
  request.has_body = chunked_body_ || content_bytes_ > 0;
  const std::string expect = request.headers.Get("Expect");
  if (!expect.empty() && !absl::EqualsIgnoreCase(expect, "100-continue")) {
    return HttpFault{417, "Expect", "Expect is not 100-continue, which is all that is known"};
  }
  return std::nullopt;
}

bool RequestParser::DecodeChunked(const std::string& encoded, absl::Span<char> decoded, size_t* encoded_bytes,
                                  size_t* decoded_bytes) {
  decoded_ = decoded;
  *encoded_bytes = 0;
  bool good = true;
  while (!is_done() && !decoded_.empty() && *encoded_bytes < encoded.size()) {
    ErrorCode error;
    *encoded_bytes += put(boost::asio::buffer(&encoded[*encoded_bytes], encoded.size() - *encoded_bytes), error);
    if (error == http::error::need_more) break;
    if (error) {
      good = false;
      break;
    }
  }
  *decoded_bytes = decoded.size() - decoded_.size();
  decoded_ = {};
  return good;
}

}  // namespace meshwright
