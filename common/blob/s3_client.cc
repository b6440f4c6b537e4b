// SPDX-License-Identifier: Apache-2.0
#include "common/blob/s3_client.h"

#include <algorithm>
#include <cstdlib>
#include <utility>

#include <absl/strings/ascii.h>
#include <absl/strings/str_cat.h>
#include <absl/time/clock.h>
#include <curl/curl.h>

#include "common/base/backoff.h"
#include "common/base/check.h"
#include "common/base/clock.h"
#include "common/base/digest.h"
#include "common/base/status_macros.h"

namespace meshwright {
namespace {

constexpr int64_t kSmallestPartBytes = int64_t{5} << 20;
constexpr BackoffOptions kBackoff = {.first = absl::Milliseconds(100), .longest = absl::Seconds(5)};
constexpr long kConnectTimeoutSeconds = 10;
// A transfer slower than this many bytes a second for so long is given up.
constexpr long kLowSpeedBytesPerSecond = 1000;
constexpr long kLowSpeedSeconds = 20;

// Characters that stand for themselves in a path, in the request and in its signature.
bool IsPlainPath(const std::string& text) {
  return std::all_of(text.begin(), text.end(), [](unsigned char c) {
    return absl::ascii_isalnum(c) || c == '-' || c == '_' || c == '.' || c == '/';
  });
}

size_t AppendBody(const char* data, size_t size, size_t count, void* body) {
  static_cast<std::string*>(body)->append(data, size * count);
  return size * count;
}

size_t ReadHeader(const char* data, size_t size, size_t count, void* etag) {
  const std::string line(data, size * count);
  const std::string name = "etag:";
  if (absl::AsciiStrToLower(line.substr(0, name.size())) == name) {
    auto& value = *static_cast<std::string*>(etag);
    value = line.substr(name.size());
    absl::StripAsciiWhitespace(&value);
  }
  return size * count;
}

// Errors in the request's own form; all others come from the network and may pass.
bool IsPermanent(CURLcode code) {
  return code == CURLE_URL_MALFORMAT || code == CURLE_UNSUPPORTED_PROTOCOL || code == CURLE_PEER_FAILED_VERIFICATION ||
         code == CURLE_OUT_OF_MEMORY || code == CURLE_BAD_FUNCTION_ARGUMENT;
}

}  // namespace

absl::Status S3Options::Validate() const {
  const auto error = [](const char* field, const std::string& value, const char* expected) {
    return absl::InvalidArgumentError(absl::StrCat("S3 ", field, " is \"", value, "\", expected ", expected));
  };
  const bool has_scheme = endpoint.rfind("http://", 0) == 0 || endpoint.rfind("https://", 0) == 0;
  if (!has_scheme || endpoint.back() == '/' || endpoint.find_first_of("?# ") != std::string::npos) {
    return error("endpoint", endpoint, "http(s)://HOST[:PORT]");
  }
  if (bucket.empty() || bucket.find('/') != std::string::npos || !IsPlainPath(bucket)) {
    return error("bucket", bucket, "letters, digits, \"-\" and \".\"");
  }
  if (!IsPlainPath(prefix) || (!prefix.empty() && (prefix.front() == '/' || prefix.back() != '/'))) {
    return error("prefix", prefix, "letters, digits, \"-\", \"_\", \".\" and \"/\", ending with \"/\", or nothing");
  }
  if (region.empty() || !IsPlainPath(region)) return error("region", region, "a name like eu-central-1");
  if (access_key_id.empty() || secret_access_key.empty()) {
    return absl::InvalidArgumentError("S3 access_key_id and secret_access_key are expected");
  }
  if (part_bytes < kSmallestPartBytes) return error("part_bytes", absl::StrCat(part_bytes), "at least 5242880");
  return absl::OkStatus();
}

absl::Status ReadS3Credentials(S3Options* options) {
  const auto read = [](const char* name) {
    const char* const value = std::getenv(name);
    return std::string(value == nullptr ? "" : value);
  };
  options->access_key_id = read("AWS_ACCESS_KEY_ID");
  options->secret_access_key = read("AWS_SECRET_ACCESS_KEY");
  options->session_token = read("AWS_SESSION_TOKEN");
  if (!options->access_key_id.empty() && !options->secret_access_key.empty()) return absl::OkStatus();
  return absl::FailedPreconditionError("the environment must say AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY");
}

std::string XmlText(const std::string& xml, const std::string& tag) {
  const std::string open = absl::StrCat("<", tag, ">");
  const size_t begin = xml.find(open);
  if (begin == std::string::npos) return "";
  const size_t end = xml.find(absl::StrCat("</", tag, ">"), begin);
  if (end == std::string::npos) return "";
  return xml.substr(begin + open.size(), end - begin - open.size());
}

S3Client::S3Client(S3Options options) : options_(std::move(options)) {
  static const CURLcode started = curl_global_init(CURL_GLOBAL_DEFAULT);
  MW_CHECK(started == CURLE_OK);
}

S3Client::~S3Client() {
  for (void* const handle : idle_handles_) curl_easy_cleanup(handle);
}

void* S3Client::TakeHandle() {
  {
    const MutexLock lock(mutex_);
    if (!idle_handles_.empty()) {
      void* const handle = idle_handles_.back();
      idle_handles_.pop_back();
      return handle;
    }
  }
  void* const handle = curl_easy_init();
  MW_CHECK(handle != nullptr);
  return handle;
}

void S3Client::ReturnHandle(void* handle) {
  const MutexLock lock(mutex_);
  idle_handles_.push_back(handle);
}

std::string S3Client::UrlOf(const std::string& key) const {
  const std::string bucket = absl::StrCat(options_.endpoint, "/", options_.bucket);
  return key.empty() ? bucket : absl::StrCat(bucket, "/", options_.prefix, key);
}

absl::StatusOr<S3Response> S3Client::Send(const S3Request& request) {
  void* const handle = TakeHandle();
  const Stopwatch stopwatch;
  Backoff backoff(kBackoff);
  while (true) {
    Attempt attempt = SendOnce(handle, request);
    const absl::Duration delay = backoff.Next();
    if (!attempt.may_retry || stopwatch.Elapsed() + delay >= options_.retry_deadline) {
      ReturnHandle(handle);
      return std::move(attempt.response);
    }
    absl::SleepFor(delay);
  }
}

S3Client::Attempt S3Client::SendOnce(void* handle, const S3Request& request) {
  curl_easy_reset(handle);  // keeps the connection
  std::string url = UrlOf(request.key);
  if (!request.query.empty()) absl::StrAppend(&url, "?", request.query);
  const std::string sha256 = request.body_sha256.empty() ? Sha256Hex(std::string()) : request.body_sha256;
  curl_slist* headers = nullptr;
  headers = curl_slist_append(headers, absl::StrCat("x-amz-content-sha256: ", sha256).c_str());
  if (!options_.session_token.empty()) {
    headers = curl_slist_append(headers, absl::StrCat("x-amz-security-token: ", options_.session_token).c_str());
  }
  S3Response response;
  curl_easy_setopt(handle, CURLOPT_URL, url.c_str());
  curl_easy_setopt(handle, CURLOPT_PROTOCOLS_STR, "http,https");
  curl_easy_setopt(handle, CURLOPT_AWS_SIGV4, absl::StrCat("aws:amz:", options_.region, ":s3").c_str());
  curl_easy_setopt(handle, CURLOPT_USERNAME, options_.access_key_id.c_str());
  curl_easy_setopt(handle, CURLOPT_PASSWORD, options_.secret_access_key.c_str());
  curl_easy_setopt(handle, CURLOPT_NOSIGNAL, 1L);
  curl_easy_setopt(handle, CURLOPT_CONNECTTIMEOUT, kConnectTimeoutSeconds);
  curl_easy_setopt(handle, CURLOPT_LOW_SPEED_LIMIT, kLowSpeedBytesPerSecond);
  curl_easy_setopt(handle, CURLOPT_LOW_SPEED_TIME, kLowSpeedSeconds);
  curl_easy_setopt(handle, CURLOPT_WRITEFUNCTION, &AppendBody);
  curl_easy_setopt(handle, CURLOPT_WRITEDATA, &response.body);
  curl_easy_setopt(handle, CURLOPT_HEADERFUNCTION, &ReadHeader);
  curl_easy_setopt(handle, CURLOPT_HEADERDATA, &response.etag);
  if (request.method == "HEAD") {
    curl_easy_setopt(handle, CURLOPT_NOBODY, 1L);
  } else if (request.method == "PUT" || request.method == "POST") {
    curl_easy_setopt(handle, CURLOPT_POSTFIELDS, request.body == nullptr ? "" : request.body);
    curl_easy_setopt(handle, CURLOPT_POSTFIELDSIZE_LARGE, static_cast<curl_off_t>(request.body_bytes));
    headers = curl_slist_append(headers, "Content-Type: application/octet-stream");
    // curl asks before it sends large bodies. Taking the question out by an empty "Expect:" makes curl 7.88 sign that
    // header and not send it, so it stays, but nobody waits long for servers that do not know it.
    curl_easy_setopt(handle, CURLOPT_EXPECT_100_TIMEOUT_MS, 50L);
    curl_easy_setopt(handle, CURLOPT_CUSTOMREQUEST, request.method.c_str());
  } else {
    curl_easy_setopt(handle, CURLOPT_CUSTOMREQUEST, request.method.c_str());
  }
  curl_easy_setopt(handle, CURLOPT_HTTPHEADER, headers);
  const CURLcode code = curl_easy_perform(handle);
  curl_slist_free_all(headers);
  if (code != CURLE_OK) {
    return {absl::UnavailableError(absl::StrCat(request.method, " ", url, ": ", curl_easy_strerror(code))),
            !IsPermanent(code)};
  }
  long status = 0;
  curl_easy_getinfo(handle, CURLINFO_RESPONSE_CODE, &status);
  response.status = static_cast<int>(status);
  if (status >= 200 && status < 300) return {std::move(response), false};
  const bool may_retry = (status >= 500 && status != 501 && status != 507) || status == 429 || status == 408 ||
                         XmlText(response.body, "Code") == "RequestTimeout";
  return {ErrorOf(request, response), may_retry};
}

absl::Status S3Client::ErrorOf(const S3Request& request, const S3Response& response) const {
  const std::string code = XmlText(response.body, "Code");
  const std::string reason = XmlText(response.body, "Message");
  const std::string message = absl::StrCat(request.method, " ", UrlOf(request.key), ": HTTP ", response.status,
                                           code.empty() ? "" : " ", code, reason.empty() ? "" : ": ", reason);
  if (code == "NoSuchBucket") return absl::FailedPreconditionError(message);
  if (code == "QuotaExceeded" || code == "XMinioStorageFull" || response.status == 507) {
    return absl::ResourceExhaustedError(message);
  }
  if (response.status == 404) return absl::NotFoundError(message);
  if (response.status == 401 || response.status == 403) return absl::PermissionDeniedError(message);
  if (response.status >= 500 || response.status == 429 || response.status == 408) {
    return absl::UnavailableError(message);
  }
  return absl::InternalError(message);
}

}  // namespace meshwright
