// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <deque>
#include <functional>
#include <string>
#include <thread>

#include <absl/status/status.h>
#include <absl/time/time.h>

#include "common/base/mutex.h"

namespace meshwright {

struct WebhookOptions {
  std::string url;     // http or https, chosen by whoever runs the service
  std::string secret;  // what bodies are signed with
  int attempts = 6;
  absl::Duration first_pause = absl::Seconds(2);  // between attempts; each is four times as long as the one before
  std::function<void(const std::string&)> warn = [](const std::string&) {};
};

// "sha256=" and the HMAC-SHA256 (RFC 2104) of "TIMESTAMP.BODY", in hexadecimal digits: the time is signed too, so that
// nobody can send an old message again.
std::string SignWebhook(const std::string& secret, const std::string& timestamp, const std::string& body);

// Tells a program elsewhere what has happened: POST of a JSON body with the headers Meshwright-Timestamp (seconds since
// 1970) and Meshwright-Signature. What is not answered with 2xx is sent again, then given up with a warning. A thread
// of its own sends one message after the other; those that wait when it is destroyed are lost. Thread-safe.
class WebhookSender {
 public:
  // InvalidArgument unless it is an address of http or https.
  static absl::Status CheckUrl(const std::string& url);

  explicit WebhookSender(WebhookOptions options);
  ~WebhookSender();
  void Send(std::string body);

 private:
  void Run();
  bool Wait(absl::Duration pause);  // false: stopping
  absl::Status SendOnce(const std::string& body) const;

  const WebhookOptions options_;
  Mutex mutex_;
  ConditionVariable wake_;
  std::deque<std::string> bodies_ ABSL_GUARDED_BY(mutex_);
  bool stopping_ ABSL_GUARDED_BY(mutex_) = false;
  std::thread thread_;
};

}  // namespace meshwright
