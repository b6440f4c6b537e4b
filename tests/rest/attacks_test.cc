// SPDX-License-Identifier: Apache-2.0
// Clients that mean harm, directly and through nginx: what they do has no effect on others, and /healthz is answered at
// once throughout.

#include <atomic>
#include <cstdio>
#include <cstdlib>

#include <absl/strings/match.h>
#include <gmock/gmock.h>
// jpeglib.h needs <cstdio> before it.
#include <jpeglib.h>

#include "common/http_server/http_testing.h"
#include "common/image/encode.h"
#include "tests/rest/nginx.h"
#include "tests/rest/rest_cluster.h"

namespace meshwright {
namespace {

using testing::HasSubstr;
using testing::StartsWith;

const std::string kToken = "0123456789abcdef";
const std::string kAuthorized = "Authorization: Bearer " + kToken + "\r\n";

// Asks another address's way for /healthz all the time, and looks at this process's memory.
class Onlooker {
 public:
  explicit Onlooker(int port)
      : before_mib_(ResidentMebibytes()), thread_([this, port] {
          while (!over_) {
            slowest_ = std::max(slowest_, SecondsOf(port, "/healthz", "127.0.0.9"));
            most_mib_ = std::max(most_mib_, ResidentMebibytes());
            std::this_thread::sleep_for(std::chrono::milliseconds(10));
          }
        }) {}
  ~Onlooker() { Stop(); }
  Onlooker(const Onlooker&) = delete;
  Onlooker& operator=(const Onlooker&) = delete;

  void ExpectNothingNoticed(double max_mib = 64) {
    Stop();
    EXPECT_LT(slowest_, 1);
    EXPECT_GT(slowest_, 0);
    EXPECT_LT(most_mib_ - before_mib_, max_mib);
  }

 private:
  void Stop() {
    over_ = true;
    if (thread_.joinable()) thread_.join();
  }
  const double before_mib_;
  double slowest_ = 0;
  double most_mib_ = 0;
  std::atomic<bool> over_ = false;
  std::thread thread_;
};

class AttacksTest : public RestCluster {
 protected:
  void SetUp() override {
    RestCluster::SetUp();
    // No worker is there that could refine the cameras.
    ASSERT_EQ(PostJson("/v1/reconstructions", R"({"id":"victim","optionsJson":"{\"refine-cameras\":0}"})")->status,
              200);
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
  Onlooker onlooker(port());
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
  onlooker.ExpectNothingNoticed();
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
  Onlooker onlooker(port());
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
  onlooker.ExpectNothingNoticed();
}

TEST_F(AttacksTest, TwoThousandStreamsFollowOneReconstruction) {
  Onlooker onlooker(port());
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
  ASSERT_EQ(http_->Post("/v1/reconstructions/victim:cancel")->status, 200);
  for (const RawClient& stream : streams) {
    ASSERT_THAT(stream.Read(20, "event: end"), HasSubstr("RECONSTRUCTION_STATE_CANCELLED"));
  }
  onlooker.ExpectNothingNoticed();
}

// A grey progressive JPEG of 4000 x 4000 whose second scan comes again and again: some kB that are decoded for long.
std::string JpegOfManyScans() {
  jpeg_compress_struct info{};
  jpeg_error_mgr errors{};
  info.err = jpeg_std_error(&errors);
  jpeg_create_compress(&info);
  unsigned char* buffer = nullptr;
  unsigned long size = 0;  // NOLINT(google-runtime-int): libjpeg's type
  jpeg_mem_dest(&info, &buffer, &size);
  info.image_width = info.image_height = 4000;
  info.input_components = 1;
  info.in_color_space = JCS_GRAYSCALE;
  jpeg_set_defaults(&info);
  jpeg_simple_progression(&info);
  jpeg_start_compress(&info, TRUE);
  std::vector<uint8_t> row(4000, 90);
  JSAMPROW rows = row.data();
  while (info.next_scanline < info.image_height) jpeg_write_scanlines(&info, &rows, 1);
  jpeg_finish_compress(&info);
  std::string bytes(reinterpret_cast<const char*>(buffer), size);
  jpeg_destroy_compress(&info);
  std::free(buffer);
  const size_t begin = bytes.find("\xFF\xDA", bytes.find("\xFF\xDA") + 2);
  size_t end = begin + 2;
  while (bytes[end] != '\xFF' || bytes[end + 1] == '\0') ++end;
  const std::string scan = bytes.substr(begin, end - begin);
  for (int i = 0; i < 60; ++i) bytes.insert(end, scan);
  return bytes;
}

// Photographs that are small until they are decoded.
TEST_F(AttacksTest, PicturesThatGrowWhenTheyAreLookedAt) {
  const std::string png =
      EncodePng({.width = 8000, .height = 8000, .rgb = std::vector<uint8_t>(size_t{3} * 8000 * 8000, 90)});
  const std::string jpeg = JpegOfManyScans();
  ASSERT_LT(png.size() + jpeg.size(), 400'000U);
  const std::pair<std::string, std::string> files[] = {
      {"model/cameras.txt", "1 PINHOLE 8000 8000 8000 8000 4000 4000\n2 PINHOLE 4000 4000 4000 4000 2000 2000\n"},
      {"model/images.txt", "1 1 0 0 0 0 0 0 1 a.png\n\n2 1 0 0 0 1 0 0 1 b.png\n\n3 1 0 0 0 2 0 0 2 c.jpg\n\n"},
      {"model/points3D.txt", ""},
      {"images/a.png", png},
      {"images/b.png", png},
      {"images/c.jpg", jpeg}};
  for (const auto& [path, content] : files) {
    ASSERT_EQ(PutPart("victim", path, content, 0, content.size())->status, 200) << path;
  }
  Onlooker onlooker(port());
  ASSERT_EQ(http_->Post("/v1/reconstructions/victim:start")->status, 200);
  const auto photo = [&](int camera) {
    return "GET /v1/reconstructions/victim/cameras/" + std::to_string(camera) +
           "/photo?width=2048 HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n";
  };
  // Until the scene is there.
  std::string first;
  for (int i = 0; i < 1200 && !absl::StartsWith(first, "HTTP/1.1 200"); ++i) {
    const RawClient client(port());
    client.Send(photo(0));
    first = client.Read(30);
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
  EXPECT_THAT(first, StartsWith("HTTP/1.1 200"));
  std::vector<RawClient> clients;
  for (int i = 0; i < 24; ++i) {
    clients.emplace_back(port(), absl::StrCat("127.0.1.", 1 + i % 6));
    clients.back().Send(photo(i % 3));
  }
  for (const RawClient& client : clients) {
    EXPECT_THAT(client.Read(120), testing::AnyOf(StartsWith("HTTP/1.1 200"), StartsWith("HTTP/1.1 4")));
  }
  // Together the 24 pictures are 3.5 GB.
  onlooker.ExpectNothingNoticed();
}

}  // namespace
}  // namespace meshwright
