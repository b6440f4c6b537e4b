// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include <absl/types/span.h>
#include <boost/beast/http/basic_parser.hpp>

#include "common/http_server/http_message.h"

namespace meshwright {

struct HeadLimits {
  size_t max_start_line_bytes = 0;
  int max_fields = 0;
};

// Reads one request: Beast's parser, and beyond it refused is what two programs could understand differently. Used
// once.
class RequestParser final : private boost::beast::http::basic_parser<true> {
 public:
  // `head` ends with the empty line. Fills in all but the caller.
  std::optional<HttpFault> ParseHead(const std::string& head, const HeadLimits& limits, HttpRequest& request);

  // Of a head that was parsed.
  bool keeps_alive() const { return keep_alive(); }
  bool is_http_1_0() const { return version_ == 10; }
  bool has_chunked_body() const { return chunked_body_; }
  int64_t content_bytes() const { return content_bytes_; }  // 0 for chunked bodies

  // Decodes what it can of `encoded`, part of a chunked body, into `decoded`. Sets how many bytes of each were used.
  // False: malformed.
  bool DecodeChunked(const std::string& encoded, absl::Span<char> decoded, size_t* encoded_bytes,
                     size_t* decoded_bytes);
  // Whether the chunked body has ended.
  bool has_ended() const { return is_done(); }

 private:
  using Verb = boost::beast::http::verb;
  using Text = boost::beast::string_view;
  using ErrorCode = boost::beast::error_code;
  void on_request_impl(Verb, Text method, Text target, int version, ErrorCode& error) override;
  void on_response_impl(int, Text, int, ErrorCode&) override {}
  void on_field_impl(boost::beast::http::field, Text name, Text value, ErrorCode& error) override;
  void on_header_impl(ErrorCode&) override {}
  void on_body_init_impl(const boost::optional<std::uint64_t>&, ErrorCode&) override {}
  std::size_t on_body_impl(Text body, ErrorCode&) override { return body.size(); }
  void on_chunk_header_impl(std::uint64_t, Text, ErrorCode&) override {}
  std::size_t on_chunk_body_impl(std::uint64_t, Text body, ErrorCode&) override;
  void on_finish_impl(ErrorCode&) override {}

  std::optional<HttpFault> CheckHead(HttpRequest& request);

  HttpRequest* request_ = nullptr;  // while its head is parsed
  std::string target_;
  int version_ = 0;
  bool chunked_body_ = false;
  int64_t content_bytes_ = 0;
  absl::Span<char> decoded_;  // what is left of it
};

}  // namespace meshwright
