// Clients that mean harm, directly and through nginx: what they do has no effect on others, and /healthz is answered at
// once throughout.

#include <atomic>

#include <absl/strings/match.h>
#include <gmock/gmock.h>

#include "common/http_server/http_testing.h"
#include "tests/rest/nginx.h"
#include "tests/rest/rest_cluster.h"

namespace meshwright {
namespace {

using testing::HasSubstr;
using testing::StartsWith;

const std::string kToken = "0123456789abcdef";
const std::string kAuthorized = "Authorization: Bearer " + kToken + "\r\n";

class AttacksTest : public RestCluster {
 protected:
  void SetUp() override {
    RestCluster::SetUp();
    ASSERT_EQ(PostJson("/v1/reconstructions", R"({"id":"victim"})")->status, 200);
  }
  void AskForTokens() {
    Stop();
    ASSERT_TRUE(WriteFileAtomically(folder_ + "/token", kToken).ok());
    settings_.api_token_file = folder_ + "/token";
    Start();
  }
  int port() const { return coordinator_->rest_port(); }
};

class BehindNginxTest : public AttacksTest {
 protected:
  void SetUp() override {
    AttacksTest::SetUp();
    AskForTokens();
    const std::string folder = folder_ + "/nginx";
    std::filesystem::create_directories(folder);
    auto started = Nginx::Start(folder, port());
    if (absl::IsNotFound(started.status())) GTEST_SKIP() << started.status().message();
    ASSERT_TRUE(started.ok()) << started.status();
    nginx_ = *std::move(started);
  }
  void TearDown() override {
    nginx_.reset();
    AttacksTest::TearDown();
  }

  std::unique_ptr<Nginx> nginx_;
};

// What a caller without a token leaves behind in the kept connection becomes the beginning of the next caller's
// request, who has one.
TEST_F(BehindNginxTest, ABodyIsNotTheBeginningOfTheNextRequest) {
  const std::string inner = "DELETE /v1/reconstructions/victim HTTP/1.1\r\nHost: x\r\nX-Rest: ";
  const std::string length = absl::StrCat("Content-Length: ", inner.size(), "\r\n");
  const std::string chunks = absl::StrCat(absl::Hex(inner.size()), "\r\n", inner, "\r\n0\r\n\r\n");
  const std::string chunked = "Transfer-Encoding: chunked\r\n";
  const std::string attacks[] = {
      "GET /v1/workers HTTP/1.1\r\nHost: x\r\n" + length + "\r\n" + inner,
      "GET /healthz HTTP/1.1\r\nHost: x\r\n" + length + "\r\n" + inner,
      "HEAD /healthz HTTP/1.1\r\nHost: x\r\n" + length + "\r\n" + inner,
      "OPTIONS /nothing HTTP/1.1\r\nHost: x\r\n" + length + "\r\n" + inner,
      "PUT /v1/workers HTTP/1.1\r\nHost: x\r\n" + length + "\r\n" + inner,
      "PUT /v1/workers HTTP/1.1\r\nHost: x\r\nExpect: 100-continue\r\n" + length + "\r\n" + inner,
      "POST /v1/reconstructions HTTP/1.1\r\nHost: x\r\n" + length + "\r\n" + inner,
      "POST /v1/reconstructions/none:start HTTP/1.1\r\nHost: x\r\n" + chunked + "\r\n" + chunks,
      "DELETE /none HTTP/1.1\r\nHost: x\r\n" + chunked + "\r\n" + chunks,
      "PATCH /healthz HTTP/1.1\r\nHost: x\r\nContent-Encoding: gzip\r\n" + length + "\r\n" + inner,
  };
  for (const int proxy : {nginx_->buffering_port(), nginx_->streaming_port()}) {
    for (const std::string& attack : attacks) {
      const RawClient attacker(proxy);
      attacker.Send(attack);
      attacker.Read(5, "\r\n\r\n");
      const RawClient user(proxy);
      user.Send("GET /v1/reconstructions/victim HTTP/1.1\r\nHost: x\r\n" + kAuthorized + "Connection: close\r\n\r\n");
      const std::string answer = user.Read(10);
      EXPECT_THAT(answer, StartsWith("HTTP/1.1 200")) << attack;
      EXPECT_THAT(answer, HasSubstr("\"id\":\"victim\"")) << attack;
      const httplib::Headers headers = {{"Authorization", "Bearer " + kToken}};
      ASSERT_EQ(http_->Get("/v1/reconstructions/victim", headers)->status, 200) << attack;
    }
  }
}

TEST_F(BehindNginxTest, UploadsAndEventsPassThrough) {
  const httplib::Headers headers = {{"Authorization", "Bearer " + kToken}};
  std::string content;
  for (int i = 0; content.size() < 3'000'000; ++i) absl::StrAppend(&content, i, ",");
  int number = 0;
  for (const int proxy : {nginx_->buffering_port(), nginx_->streaming_port()}) {
    for (const bool chunked : {false, true}) {
      const std::string query = absl::StrCat("/v1/reconstructions/victim/files/f", ++number, "?size=", content.size(),
                                             "&sha256=", Sha256Hex(content));
      const std::string head = "PUT " + query + " HTTP/1.1\r\nHost: x\r\n" + kAuthorized + "Connection: close\r\n";
      const RawClient client(proxy);
      if (chunked) {
        client.Send(absl::StrCat(head, "Transfer-Encoding: chunked\r\n\r\n", absl::Hex(content.size()), "\r\n", content,
                                 "\r\n0\r\n\r\n"));
      } else {
        client.Send(absl::StrCat(head, "Content-Length: ", content.size(), "\r\n\r\n", content));
      }
      const std::string answer = client.Read(20);
      EXPECT_THAT(answer, StartsWith("HTTP/1.1 200"));
      EXPECT_THAT(answer, HasSubstr("\"complete\":true"));
    }
    const RawClient follower(proxy);
    follower.Send("GET /v1/reconstructions/victim/events HTTP/1.1\r\nHost: x\r\n" + kAuthorized + "\r\n");
    EXPECT_THAT(follower.Read(5, "event: reconstruction"), HasSubstr("event: reconstruction"));
  }
}

TEST_F(AttacksTest, OthersAreServedAtOnceThroughout) {
  const double before = ResidentMebibytes();
  std::atomic<bool> over = false;
  double slowest = 0;
  std::thread watcher([&] {
    while (!over) {
      slowest = std::max(slowest, SecondsOf(port(), "/healthz", "127.0.0.9"));
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
  });
  std::vector<RawClient> slow;
  for (int i = 0; i < 300; ++i) {
    slow.emplace_back(port());
    slow.back().Send(i % 2 == 0
                         ? "GET /healthz HTTP/1.1\r\nX: "
                         : "PUT /v1/reconstructions/victim/files/a?size=9 HTTP/1.1\r\nHost: x\r\nContent-Length: "
                           "9\r\n\r\n");
  }
  // Header fields without an end.
  const std::string fields = [] {
    std::string text;
    for (int i = 0; i < 250; ++i) absl::StrAppend(&text, "H", i, ": ", std::string(4000, 'v'), "\r\n");
    return text;
  }();
  for (int i = 0; i < 20; ++i) {
    const RawClient flood(port());
    flood.Send("GET /healthz HTTP/1.1\r\n");
    for (int j = 0; j < 20 && flood.Send(fields); ++j) continue;
  }
  // Streams of one caller: it gets its share, and others get theirs.
  std::vector<RawClient> streams;
  const std::string watch = "GET /v1/reconstructions/victim/events HTTP/1.1\r\nHost: x\r\n\r\n";
  size_t granted = 0;
  for (int i = 0; i < 400; ++i) {
    streams.emplace_back(port(), "127.0.0.2");
    streams.back().Send(watch);
  }
  for (const RawClient& stream : streams) {
    const std::string answer = stream.Read(10, "\r\n\r\n");
    if (absl::StartsWith(answer, "HTTP/1.1 200")) {
      ++granted;
    } else {
      EXPECT_THAT(answer, StartsWith("HTTP/1.1 429"));
      EXPECT_THAT(answer, HasSubstr("Retry-After"));
    }
  }
  EXPECT_EQ(granted, 250U);
  const RawClient other(port(), "127.0.0.3");
  other.Send(watch);
  EXPECT_THAT(other.Read(5, "event: reconstruction"), StartsWith("HTTP/1.1 200"));
  EXPECT_EQ(http_->Get("/v1/reconstructions/victim")->status, 200);
  over = true;
  watcher.join();
  EXPECT_LT(slowest, 1);
  EXPECT_LT(ResidentMebibytes() - before, 64);
}

TEST_F(AttacksTest, TwoThousandStreamsFollowOneReconstruction) {
  const double before = ResidentMebibytes();
  const int threads = ThreadCount();
  std::vector<RawClient> streams;
  for (int i = 0; i < 2000; ++i) {
    streams.emplace_back(port(), absl::StrCat("127.0.2.", 1 + i % 20));
    streams.back().Send("GET /v1/reconstructions/victim/events HTTP/1.1\r\nHost: x\r\n\r\n");
  }
  for (const RawClient& stream : streams) {
    ASSERT_THAT(stream.Read(20, "event: reconstruction"), StartsWith("HTTP/1.1 200"));
  }
  EXPECT_LE(ThreadCount(), threads);
  EXPECT_LT(ResidentMebibytes() - before, 64);
  EXPECT_LT(SecondsOf(port(), "/healthz"), 1);
  ASSERT_EQ(http_->Post("/v1/reconstructions/victim:cancel")->status, 200);
  for (const RawClient& stream : streams) {
    ASSERT_THAT(stream.Read(20, "event: end"), HasSubstr("RECONSTRUCTION_STATE_CANCELLED"));
  }
}

}  // namespace
}  // namespace meshwright
// SPDX-License-Identifier: Apache-2.0
