// SPDX-License-Identifier: Apache-2.0
#include "coordinator/webhook/webhook_sender.h"

#include <atomic>
#include <string>
#include <vector>

#include <absl/strings/str_cat.h>
#include <absl/time/clock.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/base/check.h"
#include "common/base/clock.h"
#include "common/http_server/http_server.h"

namespace meshwright {
namespace {

using testing::HasSubstr;

// A receiver that answers with one status after the other, the last one for good.
class Receiver final : public HttpHandler {
 public:
  struct Message {
    std::string timestamp;
    std::string signature;
    std::string body;
  };

  explicit Receiver(std::vector<int> statuses) : statuses_(std::move(statuses)) {
    auto started = HttpServer::Start({.listen = "127.0.0.1:0"}, *this);
    MW_CHECK(started.ok());
    server_ = *std::move(started);
  }
  std::string url() const { return absl::StrCat("http://127.0.0.1:", server_->port(), "/hook?of=tests"); }

  // The first `count` messages, or those that have come within 20 seconds.
  std::vector<Message> WaitFor(size_t count) {
    for (int i = 0; i < 2000; ++i) {
      {
        const MutexLock lock(mutex_);
        if (messages_.size() >= count) return messages_;
      }
      absl::SleepFor(absl::Milliseconds(10));
    }
    const MutexLock lock(mutex_);
    return messages_;
  }

 private:
  class Body final : public HttpBodySink {
   public:
    explicit Body(Receiver& receiver) : receiver_(receiver) {}
    int64_t max_bytes() const override { return 1 << 20; }
    bool Take(absl::Span<const uint8_t> bytes) override {
      text_.append(bytes.begin(), bytes.end());
      return true;
    }
    void Finish(HttpExchange& exchange) override {
      const MutexLock lock(receiver_.mutex_);
      const HttpHeaders& headers = exchange.request.headers;
      receiver_.messages_.push_back({headers.Get("Meshwright-Timestamp"), headers.Get("Meshwright-Signature"), text_});
      const size_t place = std::min(receiver_.messages_.size(), receiver_.statuses_.size()) - 1;
      exchange.response.status = receiver_.statuses_[place];
      exchange.response.SetContent("", "text/plain");
    }

   private:
    Receiver& receiver_;
    std::string text_;
  };
  void Handle(HttpExchange& exchange) override { exchange.body = std::make_unique<Body>(*this); }
  void AnswerFault(const HttpFault& fault, HttpResponse& response) override { response.status = fault.status; }

  const std::vector<int> statuses_;
  Mutex mutex_;
  std::vector<Message> messages_ ABSL_GUARDED_BY(mutex_);
  std::unique_ptr<HttpServer> server_;
};

TEST(WebhookSenderTest, MessagesAreSignedAndComeInTheirOrder) {
  Receiver receiver({200, 204});
  WebhookSender sender({.url = receiver.url(), .secret = "secret"});
  sender.Send(R"({"id":"one"})");
  sender.Send(R"({"id":"two"})");
  const auto messages = receiver.WaitFor(2);
  ASSERT_EQ(messages.size(), 2U);
  EXPECT_EQ(messages[0].body, R"({"id":"one"})");
  EXPECT_EQ(messages[1].body, R"({"id":"two"})");
  for (const auto& message : messages) {
    EXPECT_EQ(message.signature, SignWebhook("secret", message.timestamp, message.body));
    EXPECT_NE(message.signature, SignWebhook("other", message.timestamp, message.body));
    EXPECT_NEAR(std::stod(message.timestamp), static_cast<double>(absl::ToUnixSeconds(SystemClock().Now())), 30);
  }
}

// echo -n 1700000000.body | openssl dgst -sha256 -hmac secret
TEST(WebhookSenderTest, OthersComputeTheSameSignature) {
  EXPECT_EQ(SignWebhook("secret", "1700000000", "body"),
            "sha256=42ac6f0448c1d9c3e1e82b9726248f58fef84afffcbad5188246e96070e0ea46");
}

TEST(WebhookSenderTest, WhatIsNotTakenIsSentAgainAndThenGivenUp) {
  std::atomic<int> warnings = 0;
  const auto warn = [&](const std::string& text) {
    EXPECT_THAT(text, HasSubstr("status 500"));
    ++warnings;
  };
  {
    Receiver receiver({500, 302, 200});
    WebhookSender sender({.url = receiver.url(), .secret = "s", .first_pause = absl::Milliseconds(1), .warn = warn});
    sender.Send("{}");
    EXPECT_EQ(receiver.WaitFor(3).size(), 3U);
  }
  EXPECT_EQ(warnings, 0);
  Receiver receiver({500});
  WebhookSender sender(
      {.url = receiver.url(), .secret = "s", .attempts = 3, .first_pause = absl::Milliseconds(1), .warn = warn});
  sender.Send("{}");
  EXPECT_EQ(receiver.WaitFor(3).size(), 3U);
  for (int i = 0; i < 500 && warnings == 0; ++i) absl::SleepFor(absl::Milliseconds(10));
  EXPECT_EQ(warnings, 1);
}

TEST(WebhookSenderTest, OnlyAddressesOfTheWebAreTaken) {
  EXPECT_TRUE(WebhookSender::CheckUrl("https://example.org/hook").ok());
  EXPECT_TRUE(WebhookSender::CheckUrl("http://[::1]:8080/hook?x=1").ok());
  for (const char* url : {"", "example.org", "file:///etc/passwd", "ftp://example.org", "https://", "http://a b/"}) {
    EXPECT_FALSE(WebhookSender::CheckUrl(url).ok()) << url;
  }
}

}  // namespace
}  // namespace meshwright
