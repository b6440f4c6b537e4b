// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <absl/time/time.h>

#include "common/base/mutex.h"

namespace meshwright {

// Where the objects are and who asks for them. Objects are addressed by path (ENDPOINT/BUCKET/KEY), which every server
// that speaks S3 understands.
struct S3Options {
  std::string endpoint;  // http(s)://HOST[:PORT], e.g. https://s3.eu-central-1.amazonaws.com
  std::string bucket;
  std::string prefix;  // before every key; "" or like "projects/castle/"
  std::string region = "us-east-1";
  std::string access_key_id;
  std::string secret_access_key;
  std::string session_token;  // "" unless the keys are temporary ones
  // Objects larger than this are uploaded in parts of this size, bytes; at least 5 MiB (a limit of S3).
  int64_t part_bytes = int64_t{64} << 20;
  // How long a request is repeated after errors of the network and of the server (5xx, 429).
  absl::Duration retry_deadline = absl::Seconds(30);

  absl::Status Validate() const;
};

// Fills in the keys from AWS_ACCESS_KEY_ID, AWS_SECRET_ACCESS_KEY and AWS_SESSION_TOKEN. FailedPrecondition when the
// first two are not set.
absl::Status ReadS3Credentials(S3Options* options);

struct S3Request {
  std::string method;  // GET, HEAD, PUT, POST or DELETE
  std::string key;     // after the prefix; "" is the bucket itself
  std::string query;   // sorted and percent-encoded, without "?"
  const char* body = nullptr;
  int64_t body_bytes = 0;
  std::string body_sha256;  // hexadecimal digits; "" for no body
};

struct S3Response {
  int status = 0;
  std::string body;
  std::string etag;
};

// Requests signed by AWS Signature Version 4. Connections are kept and reused. Thread-safe.
class S3Client {
 public:
  explicit S3Client(S3Options options);
  S3Client(const S3Client&) = delete;
  S3Client& operator=(const S3Client&) = delete;
  ~S3Client();

  const S3Options& options() const { return options_; }
  // The object's address, for messages.
  std::string UrlOf(const std::string& key) const;

  // Answers 2xx; everything else is an error that names the address: NotFound, PermissionDenied, FailedPrecondition (no
  // such bucket), ResourceExhausted (storage full), Unavailable (still failing when retry_deadline ends), else
  // Internal.
  absl::StatusOr<S3Response> Send(const S3Request& request);

 private:
  struct Attempt {
    absl::StatusOr<S3Response> response;
    bool may_retry = false;  // another attempt may help
  };
  Attempt SendOnce(void* handle, const S3Request& request);
  absl::Status ErrorOf(const S3Request& request, const S3Response& response) const;
  void* TakeHandle();
  void ReturnHandle(void* handle);

  const S3Options options_;
  Mutex mutex_;
  std::vector<void*> idle_handles_ ABSL_GUARDED_BY(mutex_);  // CURL*
};

// The text between <tag> and </tag>, "" when there is none.
std::string XmlText(const std::string& xml, const std::string& tag);

}  // namespace meshwright
