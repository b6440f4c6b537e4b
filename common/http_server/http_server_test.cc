// SPDX-License-Identifier: Apache-2.0
// The server held against clients that mean it harm. What it has to promise: every request is answered once, bodies are
// never taken for requests, and whatever some clients do, the others are answered at once.

#include "common/http_server/http_server.h"

#include <atomic>
#include <filesystem>
#include <mutex>
#include <set>
#include <thread>

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <boost/asio/connect.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/read.hpp>
#include <boost/asio/ssl.hpp>
#include <boost/asio/write.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/base/check.h"
#include "common/http_server/http_testing.h"

namespace meshwright {
namespace {

using testing::HasSubstr;
using testing::StartsWith;

const std::string kHost = "Host: x\r\n";

// MiB of what is freed.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr double kKeptByTheSanitizer = 448;
#else
constexpr double kKeptByTheSanitizer = 0;
#endif

// Counts up for whoever listens.
class Ticker {
 public:
  void Tick() {
    const std::lock_guard<std::mutex> lock(mutex_);
    ++ticks_;
    for (const auto& [source, wake] : wakes_) wake();
  }
  int sources() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return static_cast<int>(wakes_.size());
  }
  std::unique_ptr<HttpEventSource> MakeSource(size_t padding, int last) {
    return std::make_unique<Source>(*this, padding, last);
  }

 private:
  class Source final : public HttpEventSource {
   public:
    Source(Ticker& ticker, size_t padding, int last) : ticker_(ticker), padding_(padding), last_(last) {}
    ~Source() override {
      const std::lock_guard<std::mutex> lock(ticker_.mutex_);
      ticker_.wakes_.erase(this);
    }
    std::optional<std::string> Next() override {
      const std::lock_guard<std::mutex> lock(ticker_.mutex_);
      if (told_ >= last_) return std::nullopt;
      if (told_ == ticker_.ticks_) return "";
      return absl::StrCat("data: ", ++told_, std::string(padding_, ' '), "\n\n");
    }
    std::string Heartbeat() override { return ":\n\n"; }
    void SetWake(std::function<void()> wake) override {
      const std::lock_guard<std::mutex> lock(ticker_.mutex_);
      ticker_.wakes_[this] = std::move(wake);
    }

   private:
    Ticker& ticker_;
    const size_t padding_;
    const int last_;
    int told_ = 0;
  };
  mutable std::mutex mutex_;
  std::map<const Source*, std::function<void()>> wakes_;
  int ticks_ = 0;
};

class CollectingSink final : public HttpBodySink {
 public:
  explicit CollectingSink(bool stops_early) : stops_early_(stops_early) {}
  int64_t max_bytes() const override { return int64_t{64} << 20; }
  bool Take(absl::Span<const uint8_t> bytes) override {
    body_.append(bytes.begin(), bytes.end());
    return !stops_early_;
  }
  void Finish(HttpExchange& exchange) override {
    if (stops_early_) {
      exchange.response.status = 409;
      exchange.response.SetContent("no", "text/plain");
    } else {
      exchange.response.SetContent(std::move(body_), "text/plain");
    }
  }

 private:
  const bool stops_early_;
  std::string body_;
};

class TestHandler final : public HttpHandler {
 public:
  bool IsQuick(const HttpRequest& request) const override { return request.path == "/quick"; }
  void Handle(HttpExchange& exchange) override {
    const HttpRequest& request = exchange.request;
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      handled_.push_back(request.method + " " + request.path);
      callers_.insert(request.caller);
    }
    if (request.path == "/echo") exchange.body = std::make_unique<CollectingSink>(false);
    if (request.path == "/stop") exchange.body = std::make_unique<CollectingSink>(true);
    if (request.path == "/slow") std::this_thread::sleep_for(std::chrono::milliseconds(200));
    if (request.path == "/throw") throw std::runtime_error("thrown on purpose");
    exchange.response.SetContent(request.path, "text/plain");
    if (request.path == "/large") {
      exchange.response.SetPieces(std::stoll(request.Param("bytes")), "text/plain",
                                  [](int64_t offset, size_t most) -> absl::StatusOr<std::string> {
                                    return std::string(std::min<size_t>(most, 100'000),
                                                       static_cast<char>('a' + offset % 7));
                                  });
    }
    if (request.path == "/events") {
      const std::string last = request.Param("last");
      const std::string padding = request.Param("padding");
      exchange.response.SetEvents("text/event-stream", ticker_.MakeSource(padding.empty() ? 0 : std::stoul(padding),
                                                                          last.empty() ? 1 << 30 : std::stoi(last)));
    }
  }
  void AnswerFault(const HttpFault& fault, HttpResponse& response) override {
    response.status = fault.status;
    response.SetContent(absl::StrCat("fault ", fault.field, " ", fault.detail), "text/plain");
  }

  std::vector<std::string> handled() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return handled_;
  }
  std::set<std::string> callers() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return callers_;
  }
  Ticker& ticker() { return ticker_; }

 private:
  mutable std::mutex mutex_;
  std::vector<std::string> handled_;
  std::set<std::string> callers_;
  Ticker ticker_;
};

class HttpServerTest : public testing::Test {
 protected:
  void SetUp() override { Start(); }
  void Start() {
    options_.listen = "127.0.0.1:0";
    options_.warn = [this](const std::string& text) {
      const std::lock_guard<std::mutex> lock(mutex_);
      warnings_.push_back(text);
    };
    server_.reset();
    auto started = HttpServer::Start(options_, handler_);
    MW_CHECK(started.ok());
    server_ = *std::move(started);
  }
  // The answers to these bytes, until the server closes or is silent.
  std::string Ask(const std::string& bytes, double seconds = 0.5) const {
    const RawClient client(server_->port());
    client.Send(bytes);
    return client.Read(seconds);
  }
  bool ConnectionsGoDownTo(int count) const {
    for (int i = 0; i < 250 && server_->connections() > count; ++i) {
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
    return server_->connections() <= count;
  }
  size_t CountHandled(const std::string& what) const {
    const std::vector<std::string> all = handler_.handled();
    return static_cast<size_t>(std::count(all.begin(), all.end(), what));
  }

  HttpServerOptions options_;
  TestHandler handler_;
  std::mutex mutex_;
  std::vector<std::string> warnings_;
  std::unique_ptr<HttpServer> server_;
};

TEST_F(HttpServerTest, AnswersRequestsThatComeBehindOneAnotherInOrder) {
  const std::string answer = Ask("GET /a HTTP/1.1\r\n" + kHost + "\r\nPOST /echo HTTP/1.1\r\n" + kHost +
                                 "Content-Length: 3\r\n\r\nxyzHEAD /c HTTP/1.1\r\n" + kHost + "\r\n");
  EXPECT_EQ(CountAnswers(answer), 3U);
  EXPECT_THAT(handler_.handled(), testing::ElementsAre("GET /a", "POST /echo", "HEAD /c"));
  EXPECT_LT(answer.find("\r\n\r\n/a"), answer.find("\r\n\r\nxyz"));
  EXPECT_THAT(answer, testing::EndsWith("Content-Length: 2\r\n\r\n"));
}

TEST_F(HttpServerTest, GivesBackBodiesHoweverTheyAreCut) {
  std::string body;
  for (int i = 0; body.size() < 700'000; ++i) absl::StrAppend(&body, i, " ");
  for (const size_t cut : {size_t{7}, size_t{4096}, size_t{128} << 10, body.size()}) {
    std::string chunks;
    for (size_t at = 0; at < body.size(); at += cut) {
      const std::string piece = body.substr(at, cut);
      absl::StrAppend(&chunks, absl::Hex(piece.size()), ";note=\"x\"\r\n", piece, "\r\n");
    }
    const std::string head = "POST /echo HTTP/1.1\r\n" + kHost + "Connection: close\r\n";
    const std::string chunked =
        Ask(head + "Transfer-Encoding: chunked\r\n\r\n" + chunks + "0\r\nTrailer: x\r\n\r\n", 20);
    EXPECT_TRUE(absl::EndsWith(chunked, "\r\n\r\n" + body)) << cut;
  }
  const RawClient client(server_->port());
  client.Send(absl::StrCat("POST /echo HTTP/1.1\r\n", kHost, "Content-Length: ", body.size(),
                           "\r\nExpect: 100-continue\r\n\r\n"));
  EXPECT_THAT(client.Read(5, "\r\n\r\n"), StartsWith("HTTP/1.1 100"));
  client.Send(body);
  EXPECT_TRUE(absl::EndsWith(client.Read(5, body), body));
}

// Each is followed by what would be a request of its own. It must not be served, by whatever reading.
TEST_F(HttpServerTest, NeverTakesABodyForARequest) {
  const std::string inner = "DELETE /inner HTTP/1.1\r\n" + kHost + "\r\n";
  const std::string length = absl::StrCat("Content-Length: ", inner.size(), "\r\n");
  const std::string chunked = "Transfer-Encoding: chunked\r\n";
  struct Case {
    std::string head;
    int status;  // 0: any, the body is dropped and the connection goes on
  };
  const Case cases[] = {
      {"GET /a HTTP/1.1\r\n" + kHost + length, 400},
      {"HEAD /a HTTP/1.1\r\n" + kHost + length, 400},
      {"OPTIONS /a HTTP/1.1\r\n" + kHost + length, 0},
      {"TRACE /a HTTP/1.1\r\n" + kHost + length, 0},
      {"PUT /a HTTP/1.1\r\n" + kHost + length, 0},
      {"DELETE /a HTTP/1.1\r\n" + kHost + length, 0},
      {"PUT /a HTTP/1.1\r\n" + kHost + "Expect: 100-continue\r\n" + length, 200},
      {"PUT /a HTTP/1.1\r\n" + kHost + "Expect: nothing\r\n" + length, 417},
      {"POST /stop HTTP/1.1\r\n" + kHost + length, 0},
      {"POST /echo HTTP/1.1\r\n" + kHost + "Content-Length: 0\r\n" + length, 400},
      {"POST /echo HTTP/1.1\r\n" + kHost + length + length, 400},
      {absl::StrCat("POST /echo HTTP/1.1\r\n", kHost, "Content-Length: ", inner.size(), ", ", inner.size(), "\r\n"),
       400},
      {absl::StrCat("POST /echo HTTP/1.1\r\n", kHost, "Content-Length: +", inner.size(), "\r\n"), 400},
      {"POST /echo HTTP/1.1\r\n" + kHost + "Content-Length: 0x10\r\n", 400},
      {"POST /echo HTTP/1.1\r\n" + kHost + "Content-Length: 99999999999999999999\r\n", 400},
      {"POST /echo HTTP/1.1\r\n" + kHost + "Content-Length:\r\n", 400},
      {"POST /echo HTTP/1.1\r\n" + kHost + length + chunked, 400},
      {"POST /echo HTTP/1.1\r\n" + kHost + chunked + length, 400},
      {"POST /echo HTTP/1.1\r\n" + kHost + chunked + chunked, 400},
      {"POST /echo HTTP/1.0\r\n" + kHost + chunked, 400},
      {"POST /echo HTTP/1.1\r\n" + kHost + "Transfer-Encoding: gzip, chunked\r\n", 501},
      {"POST /echo HTTP/1.1\r\n" + kHost + "Transfer-Encoding: xchunked\r\n", 501},
      {"POST /echo HTTP/1.1\r\n" + kHost + "Transfer-Encoding: chunked, identity\r\n", 501},
      {"POST /echo HTTP/1.1\r\n" + kHost + "Transfer-Encoding : chunked\r\n", 400},
      {"POST /echo HTTP/1.1\r\n" + kHost + "X: y\r\n Transfer-Encoding: chunked\r\n", 400},
      {"POST /echo HTTP/1.1\r\n Folded: x\r\n" + kHost + length, 400},
      {"POST /echo HTTP/1.1\r\n" + kHost + "Transfer-Encoding: chunked\nX: y\r\n", 400},
      {std::string("POST /echo HTTP/1.1\r\n") + kHost + "X: a" + std::string(1, '\0') + "b\r\n" + length, 400},
      {"POST /echo HTTP/1.1\r\n" + kHost + kHost + length, 400},
      {"POST /echo HTTP/1.1\r\n" + length, 400},
      {"POST /echo HTTP/2.0\r\n" + kHost + length, 400},
      {"BREW /echo HTTP/1.1\r\n" + kHost + length, 400},
      {"POST echo HTTP/1.1\r\n" + kHost + length, 400},
      {"POST  /echo HTTP/1.1\r\n" + kHost + length, 400},
  };
  for (const Case& c : cases) {
    const RawClient client(server_->port());
    client.Send(c.head + "\r\n");
    std::this_thread::sleep_for(std::chrono::milliseconds(20));  // so that they come apart
    client.Send(inner + "GET /after HTTP/1.1\r\n" + kHost + "\r\n");
    const std::string answers = client.Read(c.status == 0 ? 0.2 : 3);
    EXPECT_EQ(CountHandled("DELETE /inner"), 0U) << c.head;
    if (c.status == 0) {
      EXPECT_EQ(CountAnswers(answers), 2U) << c.head << answers;
    } else {
      EXPECT_THAT(answers, StartsWith(absl::StrCat("HTTP/1.1 ", c.status))) << c.head;
      EXPECT_THAT(answers, HasSubstr("Connection: close")) << c.head;
      EXPECT_EQ(CountAnswers(answers), 1U) << c.head << answers;
    }
  }
}

TEST_F(HttpServerTest, NamesTheFieldThatIsToBlame) {
  const auto fault = [&](const std::string& fields) { return Ask("POST /echo HTTP/1.1\r\n" + fields + "\r\n"); };
  EXPECT_THAT(fault(kHost + "Content-Length: -5\r\n"), HasSubstr("fault Content-Length "));
  EXPECT_THAT(fault(kHost + "Content-Length: 5\r\nContent-Length: 5\r\n"), HasSubstr("fault Content-Length "));
  EXPECT_THAT(fault(kHost + "Content-Length: 5\r\nContent-Length: 6\r\n"), HasSubstr("fault Content-Length "));
  EXPECT_THAT(fault(kHost + "Content-Length: 5\r\nTransfer-Encoding: chunked\r\n"),
              HasSubstr("fault Transfer-Encoding "));
  EXPECT_THAT(fault("X: y\r\n"), HasSubstr("fault Host "));
  EXPECT_THAT(fault(kHost + "Expect: 200\r\n"), HasSubstr("fault Expect "));
}

TEST_F(HttpServerTest, RefusesChunksThatCannotBeUnderstood) {
  const std::string head = "POST /echo HTTP/1.1\r\n" + kHost + "Transfer-Encoding: chunked\r\n\r\n";
  for (const std::string& chunks :
       {std::string("zz\r\n{}\r\n0\r\n\r\n"), std::string("-1\r\nx\r\n0\r\n\r\n"), std::string("0x1\r\nx\r\n0\r\n\r\n"),
        std::string("1\r\nxy\r\n0\r\n\r\n"), std::string("ffffffffffffffffff\r\nx\r\n"), std::string("\r\n"),
        std::string(100'000, '1'), "1;" + std::string(100'000, 'a'), "0\r\n" + std::string(100'000, 'a'),
        std::string("0\r\nContent-Length: 5\r\n\r\n")}) {
    const std::string answer = Ask(head + chunks, 3);
    EXPECT_THAT(answer, StartsWith("HTTP/1.1 400")) << chunks.substr(0, 40);
    EXPECT_EQ(CountAnswers(answer), 1U) << chunks.substr(0, 40);
  }
}

TEST_F(HttpServerTest, AnswersTheClientThatGoesOnSendingWhatIsNotWanted) {
  // More than is dropped in silence: the answer arrives, and the connection is closed.
  const RawClient client(server_->port());
  client.Send(absl::StrCat("PUT /stop HTTP/1.1\r\n", kHost, "Content-Length: ", 60 << 20, "\r\n\r\n"));
  const std::string piece(1 << 20, 'x');
  for (int i = 0; i < 6 && client.Send(piece); ++i) continue;
  const std::string answer = client.Read(5);
  EXPECT_THAT(answer, StartsWith("HTTP/1.1 409"));
  EXPECT_THAT(answer, HasSubstr("Connection: close"));
  EXPECT_THAT(Ask(absl::StrCat("PUT /echo HTTP/1.1\r\n", kHost, "Content-Length: ", int64_t{1} << 40, "\r\n\r\n")),
              StartsWith("HTTP/1.1 413"));
}

TEST_F(HttpServerTest, BoundsTheHead) {
  EXPECT_THAT(Ask("GET /" + std::string(9000, 'a') + " HTTP/1.1\r\n" + kHost + "\r\n"), StartsWith("HTTP/1.1 414"));
  EXPECT_THAT(Ask("GET /" + std::string(100'000, 'a')), StartsWith("HTTP/1.1 414"));
  EXPECT_THAT(Ask("GET /a HTTP/1.1\r\n" + kHost + "X: " + std::string(20'000, 'a') + "\r\n\r\n"),
              StartsWith("HTTP/1.1 431"));
  std::string many;
  for (int i = 0; i < 101; ++i) absl::StrAppend(&many, "X", i, ": 1\r\n");
  EXPECT_THAT(Ask("GET /a HTTP/1.1\r\n" + kHost + many + "\r\n"), StartsWith("HTTP/1.1 431"));
  // However much is sent, no more than the bound is kept.
  const double before = ResidentMebibytes();
  const RawClient client(server_->port());
  client.Send("GET /a HTTP/1.1\r\n");
  const std::string lines = [] {
    std::string text;
    for (int i = 0; i < 250; ++i) absl::StrAppend(&text, "H", i, ": ", std::string(4000, 'v'), "\r\n");
    return text;
  }();
  int sent = 0;
  while (sent < 200 && client.Send(lines)) ++sent;
  EXPECT_LT(sent, 200) << "the server read 200 MB of header fields";
  EXPECT_LT(ResidentMebibytes() - before, 16);
}

TEST_F(HttpServerTest, AFailureOfOneRequestIsItsOwn) {
  EXPECT_THAT(Ask("GET /throw HTTP/1.1\r\n" + kHost + "\r\n"), StartsWith("HTTP/1.1 500"));
  EXPECT_THAT(Ask("GET /a HTTP/1.1\r\n" + kHost + "Connection: close\r\n\r\n"), StartsWith("HTTP/1.1 200"));
  const std::lock_guard<std::mutex> lock(mutex_);
  EXPECT_THAT(warnings_, testing::ElementsAre(HasSubstr("on purpose")));
}

TEST_F(HttpServerTest, HasDeadlinesForAllThatIsSent) {
  options_.head_timeout = absl::Milliseconds(400);
  options_.idle_timeout = absl::Milliseconds(400);
  options_.keep_alive_timeout = absl::Milliseconds(400);
  Start();
  const auto drip = [&](const std::string& begin) {
    const RawClient client(server_->port());
    client.Send(begin);
    for (int i = 0; i < 40; ++i) {  // 4 s, each byte well before any deadline
      if (client.IsClosedWithin(0.1) || !client.Send("a")) return true;
    }
    return false;
  };
  EXPECT_TRUE(drip("")) << "a head without an end";
  EXPECT_TRUE(drip("GET /a HTTP/1.1\r\nX: ")) << "a header without an end";
  EXPECT_TRUE(drip("GET /a HTTP/1.1\r\n" + kHost + "\r\nGET /b")) << "the head of a second request";
  EXPECT_TRUE(drip("POST /echo HTTP/1.1\r\n" + kHost + "Content-Length: 1000\r\n\r\n")) << "a body";
  EXPECT_TRUE(drip("POST /a HTTP/1.1\r\n" + kHost + "Content-Length: 1000\r\n\r\n")) << "a body that nobody wants";
  EXPECT_TRUE(drip("POST /echo HTTP/1.1\r\n" + kHost + "Transfer-Encoding: chunked\r\n\r\n1000\r\n")) << "a chunk";
  const RawClient idle(server_->port());
  idle.Send("GET /a HTTP/1.1\r\n" + kHost + "\r\n");
  EXPECT_THAT(idle.Read(5, "\r\n\r\n/a"), StartsWith("HTTP/1.1 200"));
  EXPECT_TRUE(idle.IsClosedWithin(2)) << "an idle connection";
  const RawClient reader(server_->port());
  reader.ShrinkReceiveBuffer();
  reader.Send("GET /large?bytes=100000000 HTTP/1.1\r\n" + kHost + "\r\n");
  EXPECT_TRUE(ConnectionsGoDownTo(0)) << "who does not read";
  // Who sends slowly and steadily is served.
  const RawClient steady(server_->port());
  steady.Send("POST /echo HTTP/1.1\r\n" + kHost + "Content-Length: 10000\r\n\r\n");
  for (int i = 0; i < 10; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
    EXPECT_TRUE(steady.Send(std::string(1000, 'a')));
  }
  EXPECT_THAT(steady.Read(5, std::string(10000, 'a')), StartsWith("HTTP/1.1 200"));
}

TEST_F(HttpServerTest, AnswersAtOnceWhateverSlowClientsDo) {
  const double before = ResidentMebibytes();
  const int threads = ThreadCount();
  std::vector<RawClient> slow;
  const std::string begins[] = {
      "GET /a HTTP/1.1\r\nX: ", "POST /echo HTTP/1.1\r\n" + kHost + "Content-Length: 100000\r\n\r\nx",
      "PUT /a HTTP/1.1\r\n" + kHost + "Transfer-Encoding: chunked\r\n\r\n100\r\n", ""};
  for (int i = 0; i < 600; ++i) {
    slow.emplace_back(server_->port());
    slow.back().Send(begins[i % 4]);
  }
  EXPECT_LT(SecondsOf(server_->port(), "/quick"), 1);
  EXPECT_LT(SecondsOf(server_->port(), "/a"), 1);  // workers are not held either
  EXPECT_EQ(ThreadCount(), threads);
  EXPECT_LT(ResidentMebibytes() - before, 64);
}

TEST_F(HttpServerTest, OneAddressHasItsShareOfConnections) {
  options_.max_connections = 40;
  options_.max_connections_per_address = 10;
  Start();
  std::vector<RawClient> greedy;
  for (int i = 0; i < 100; ++i) greedy.emplace_back(server_->port(), "127.0.0.2");
  EXPECT_LT(SecondsOf(server_->port(), "/a"), 1);
  EXPECT_LE(server_->connections(), 11);
  // All together have no more than the total.
  for (int i = 0; i < 100; ++i) greedy.emplace_back(server_->port(), absl::StrCat("127.0.1.", i + 1));
  std::this_thread::sleep_for(std::chrono::milliseconds(200));
  EXPECT_LE(server_->connections(), 40);
  greedy.clear();
  EXPECT_TRUE(ConnectionsGoDownTo(0));
  EXPECT_LT(SecondsOf(server_->port(), "/a"), 1);
}

TEST_F(HttpServerTest, OneCallerDoesNotHoldAllWorkers) {
  std::vector<RawClient> greedy;
  for (int i = 0; i < 100; ++i) {  // 10 s of work for the workers that one caller gets
    greedy.emplace_back(server_->port(), "127.0.0.2");
    greedy.back().Send("GET /slow HTTP/1.1\r\n" + kHost + "\r\n");
  }
  std::this_thread::sleep_for(std::chrono::milliseconds(100));
  EXPECT_LT(SecondsOf(server_->port(), "/a"), 0.5);
  EXPECT_LT(SecondsOf(server_->port(), "/quick", "127.0.0.2"), 0.5);
}

TEST_F(HttpServerTest, BelievesTrustedProxiesAlone) {
  const std::string forwarded = "X-Forwarded-For: 6.6.6.6, 10.0.0.7, 127.0.0.3\r\nConnection: close\r\n\r\n";
  Ask("GET /a HTTP/1.1\r\n" + kHost + forwarded);
  EXPECT_THAT(handler_.callers(), testing::ElementsAre("127.0.0.1"));
  options_.trusted_proxies = {"127.0.0.1", "127.0.0.3"};
  Start();
  Ask("GET /a HTTP/1.1\r\n" + kHost + forwarded);
  EXPECT_THAT(handler_.callers(), testing::ElementsAre("10.0.0.7", "127.0.0.1"));
}

TEST_F(HttpServerTest, StreamsEventsToManyWithoutAThreadEach) {
  constexpr int kStreams = 2000;
  constexpr int kTicks = 3;
  const double before = ResidentMebibytes();
  const int threads = ThreadCount();
  std::vector<RawClient> clients;
  for (int i = 0; i < kStreams; ++i) {
    clients.emplace_back(server_->port(), absl::StrCat("127.0.2.", 1 + i % 20));
    clients.back().Send("GET /events HTTP/1.1\r\n" + kHost + "\r\n");
  }
  for (int i = 0; i < 500 && handler_.ticker().sources() < kStreams; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  ASSERT_EQ(handler_.ticker().sources(), kStreams);
  for (int i = 0; i < kTicks; ++i) handler_.ticker().Tick();
  for (const RawClient& client : clients) {
    const std::string text = client.Read(10, "data: 3\n\n");
    ASSERT_THAT(text, testing::ContainsRegex("data: 1\n\n\r\n.*\r\ndata: 2\n\n\r\n.*\r\ndata: 3\n\n")) << text;
  }
  EXPECT_LT(SecondsOf(server_->port(), "/quick"), 1);
  EXPECT_EQ(ThreadCount(), threads);
  EXPECT_LT(ResidentMebibytes() - before, 64 + kKeptByTheSanitizer);
  // Who goes away is forgotten, without anything being sent to it.
  clients.clear();
  for (int i = 0; i < 500 && handler_.ticker().sources() > 0; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  EXPECT_EQ(handler_.ticker().sources(), 0);
}

TEST_F(HttpServerTest, EndsStreamsThatAreOverAndThoseThatNobodyReads) {
  options_.idle_timeout = absl::Milliseconds(400);
  options_.event_heartbeat = absl::Milliseconds(100);
  Start();
  for (int i = 0; i < 2; ++i) handler_.ticker().Tick();
  const std::string whole = Ask("GET /events?last=2 HTTP/1.1\r\n" + kHost + "\r\n", 5);
  EXPECT_THAT(whole, testing::EndsWith("data: 2\n\n\r\n0\r\n\r\n"));
  const std::string old = Ask("GET /events?last=2 HTTP/1.0\r\n\r\n", 5);
  EXPECT_THAT(old, testing::EndsWith("\r\n\r\ndata: 1\n\ndata: 2\n\n"));
  EXPECT_THAT(Ask("GET /events?last=3 HTTP/1.1\r\n" + kHost + "\r\n", 0.5), HasSubstr("3\r\n:\n\n\r\n"));
  const RawClient deaf(server_->port());
  deaf.ShrinkReceiveBuffer();
  deaf.Send("GET /events?padding=1000000 HTTP/1.1\r\n" + kHost + "\r\n");
  for (int i = 0; i < 100; ++i) handler_.ticker().Tick();
  for (int i = 0; i < 250 && handler_.ticker().sources() > 0; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  EXPECT_EQ(handler_.ticker().sources(), 0);
}

TEST_F(HttpServerTest, ShutsDownWhatWaitsAndAnswersWhatIsAsked) {
  const RawClient idle(server_->port());
  const RawClient busy(server_->port());
  busy.Send("GET /slow HTTP/1.1\r\n" + kHost + "\r\n");
  for (int i = 0; i < 100 && CountHandled("GET /slow") == 0; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  server_->Shutdown(absl::Seconds(5));
  EXPECT_THAT(busy.Read(1), StartsWith("HTTP/1.1 200"));
  EXPECT_TRUE(idle.IsClosedWithin(1));
}

TEST(HttpServerStartTest, NamesWhatIsWrong) {
  TestHandler handler;
  for (const char* listen : {"", "1", ":1", "127.0.0.1:", "127.0.0.1:65536", "127.0.0.1:x"}) {
    EXPECT_TRUE(absl::IsInvalidArgument(HttpServer::Start({.listen = listen}, handler).status())) << listen;
  }
  const auto first = HttpServer::Start({.listen = "127.0.0.1:0"}, handler);
  ASSERT_TRUE(first.ok());
  const auto second = HttpServer::Start({.listen = absl::StrCat("127.0.0.1:", (*first)->port())}, handler);
  EXPECT_TRUE(absl::IsUnavailable(second.status())) << second.status();
  const auto no_file = HttpServer::Start(
      {.listen = "127.0.0.1:0", .tls_certificate_file = "/none.pem", .tls_key_file = "/none.key"}, handler);
  EXPECT_THAT(std::string(no_file.status().message()), HasSubstr("/none.pem"));
}

namespace net = boost::asio;

// The name in the certificate, and the answer; "" when there is none.
std::pair<std::string, std::string> AskOverTls(int port, const std::string& request) {
  net::io_context io;
  net::ssl::context context(net::ssl::context::tls_client);
  net::ssl::stream<net::ip::tcp::socket> stream(io, context);
  boost::system::error_code error;
  stream.next_layer().connect({net::ip::address_v4::loopback(), static_cast<uint16_t>(port)}, error);
  stream.handshake(net::ssl::stream_base::client, error);
  if (error) return {"", ""};
  char name[64] = "";
  X509* const certificate = SSL_get1_peer_certificate(stream.native_handle());
  X509_NAME_get_text_by_NID(X509_get_subject_name(certificate), NID_commonName, name, sizeof(name));
  X509_free(certificate);
  net::write(stream, net::buffer(request), error);
  std::string answer;
  net::read(stream, net::dynamic_buffer(answer), error);
  return {name, answer};
}

TEST_F(HttpServerTest, SpeaksTlsAndTakesUpANewCertificate) {
  std::string folder = testing::TempDir() + "tls_XXXXXX";
  MW_CHECK(mkdtemp(folder.data()) != nullptr);
  options_.tls_certificate_file = folder + "/certificate.pem";
  options_.tls_key_file = folder + "/key.pem";
  ASSERT_TRUE(WriteTestCertificate("first", options_.tls_certificate_file, options_.tls_key_file).ok());
  Start();
  std::string body;
  for (int i = 0; body.size() < 1'000'000; ++i) absl::StrAppend(&body, i, " ");
  const std::string request = absl::StrCat("POST /echo HTTP/1.1\r\n", kHost,
                                           "Connection: close\r\nContent-Length: ", body.size(), "\r\n\r\n", body);
  const auto [name, answer] = AskOverTls(server_->port(), request);
  EXPECT_EQ(name, "first");
  EXPECT_TRUE(absl::EndsWith(answer, "\r\n\r\n" + body));
  EXPECT_THAT(Ask("GET /a HTTP/1.1\r\n" + kHost + "\r\n"), testing::Not(HasSubstr("200 OK")));

  ASSERT_TRUE(WriteTestCertificate("second", options_.tls_certificate_file, options_.tls_key_file).ok());
  EXPECT_EQ(AskOverTls(server_->port(), request).first, "second");
  // The key of another certificate: the old pair goes on, and somebody is told.
  ASSERT_TRUE(WriteTestCertificate("third", folder + "/other.pem", options_.tls_key_file).ok());
  EXPECT_EQ(AskOverTls(server_->port(), request).first, "second");
  EXPECT_EQ(AskOverTls(server_->port(), request).first, "second");
  std::filesystem::rename(folder + "/other.pem", options_.tls_certificate_file);
  EXPECT_EQ(AskOverTls(server_->port(), request).first, "third");
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    EXPECT_THAT(warnings_, testing::ElementsAre(HasSubstr("key.pem")));
  }
  // Streams and idle handshakes need no thread here either.
  std::vector<RawClient> silent;
  for (int i = 0; i < 300; ++i) silent.emplace_back(server_->port());
  EXPECT_EQ(AskOverTls(server_->port(), request).first, "third");
  handler_.ticker().Tick();
  EXPECT_THAT(AskOverTls(server_->port(), "GET /events?last=1 HTTP/1.1\r\n" + kHost + "\r\n").second,
              testing::EndsWith("data: 1\n\n\r\n0\r\n\r\n"));
  server_.reset();
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace meshwright
