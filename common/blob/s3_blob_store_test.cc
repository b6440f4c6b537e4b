// SPDX-License-Identifier: Apache-2.0
#include "common/blob/s3_blob_store.h"

#include <cstdlib>
#include <filesystem>
#include <fstream>

#include <absl/strings/str_cat.h>
#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include "common/blob/blob_store_conformance.h"
#include "common/blob/s3_testing.h"

namespace meshwright {
namespace {

using testing::HasSubstr;
using testing::Not;

// Started with the first test that needs it.
S3Server* SharedServer(std::string* reason) {
  static const auto server = S3Server::Start();
  if (server.ok()) return server->get();
  *reason = server.status().ToString();
  return nullptr;
}

class S3Harness : public BlobStoreHarness {
 public:
  explicit S3Harness(S3Server* server)
      : server_(server), options_(server->NewOptions()), store_(*S3BlobStore::Open(options_)) {}
  BlobStore& store() override { return *store_; }
  std::unique_ptr<BlobStore> OpenAgain() override { return *S3BlobStore::Open(options_); }
  void Overwrite(const std::string& digest, const std::string& bytes) override {
    std::ofstream(server_->FileOf(options_, S3BlobStore::KeyOf(digest)), std::ios::binary | std::ios::trunc) << bytes;
  }

 private:
  S3Server* const server_;
  const S3Options options_;
  const std::unique_ptr<S3BlobStore> store_;
};

std::unique_ptr<BlobStoreHarness> MakeS3Harness(std::string* skip) {
  S3Server* const server = SharedServer(skip);
  return server == nullptr ? nullptr : std::make_unique<S3Harness>(server);
}

INSTANTIATE_TEST_SUITE_P(S3, BlobStoreConformanceTest, testing::Values(&MakeS3Harness));

class S3BlobStoreTest : public testing::Test {
 protected:
  void SetUp() override {
    std::string reason;
    server_ = SharedServer(&reason);
    if (server_ == nullptr) GTEST_SKIP() << reason;
  }
  S3Server* server_ = nullptr;
};

TEST_F(S3BlobStoreTest, LargeBlobsGoInParts) {
  S3Options options = server_->NewOptions();
  options.part_bytes = int64_t{5} << 20;
  options.session_token = "temporary";
  const auto store = *S3BlobStore::Open(options);
  std::string bytes(static_cast<size_t>(12) << 20, '\0');
  for (size_t i = 0; i < bytes.size(); ++i) bytes[i] = static_cast<char>(i * 2654435761U >> 16);
  const auto digest = store->Put(bytes);
  ASSERT_TRUE(digest.ok()) << digest.status();
  const auto got = store->Get(*digest);
  ASSERT_TRUE(got.ok()) << got.status();
  EXPECT_TRUE(*got == bytes);
}

TEST_F(S3BlobStoreTest, ABucketThatIsNotThereIsNamed) {
  S3Options options = server_->NewOptions();
  options.bucket = "nowhere";
  const absl::Status status = S3BlobStore::Open(options).status();
  EXPECT_TRUE(absl::IsFailedPrecondition(status)) << status;
  EXPECT_THAT(status.ToString(), HasSubstr("/nowhere"));
}

TEST_F(S3BlobStoreTest, AWrongKeyIsRefusedAndNotRepeated) {
  S3Options options = server_->NewOptions();
  options.secret_access_key = "not the secret";
  const absl::Status status = S3BlobStore::Open(options).status();
  EXPECT_TRUE(absl::IsPermissionDenied(status)) << status;
  EXPECT_THAT(status.ToString(), Not(HasSubstr("not the secret")));
}

TEST(S3OptionsTest, WhatIsWrongIsNamed) {
  S3Options good;
  good.endpoint = "http://127.0.0.1:1";
  good.bucket = "b";
  good.access_key_id = good.secret_access_key = "k";
  EXPECT_TRUE(good.Validate().ok());
  const auto expect_bad = [&](const char* word, const auto& change) {
    S3Options bad = good;
    change(bad);
    const absl::Status status = bad.Validate();
    EXPECT_TRUE(absl::IsInvalidArgument(status)) << status;
    EXPECT_THAT(status.ToString(), HasSubstr(word));
  };
  expect_bad("endpoint", [](S3Options& o) { o.endpoint = "s3.example.com"; });
  expect_bad("endpoint", [](S3Options& o) { o.endpoint = "http://s3.example.com/"; });
  expect_bad("bucket", [](S3Options& o) { o.bucket = "a/b"; });
  expect_bad("prefix", [](S3Options& o) { o.prefix = "scenes"; });
  expect_bad("prefix", [](S3Options& o) { o.prefix = "a?b/"; });
  expect_bad("region", [](S3Options& o) { o.region = ""; });
  expect_bad("secret_access_key", [](S3Options& o) { o.secret_access_key = ""; });
  expect_bad("part_bytes", [](S3Options& o) { o.part_bytes = 1000; });
}

// Answers connections one after the other with what it was told to, or by hanging up ("").
class ScriptedServer {
 public:
  explicit ScriptedServer(std::vector<std::string> answers) : socket_(::socket(AF_INET, SOCK_STREAM, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof(address);
    EXPECT_EQ(::bind(socket_, reinterpret_cast<sockaddr*>(&address), size), 0);
    EXPECT_EQ(::listen(socket_, 8), 0);
    EXPECT_EQ(::getsockname(socket_, reinterpret_cast<sockaddr*>(&address), &size), 0);
    options_.endpoint = absl::StrCat("http://127.0.0.1:", ntohs(address.sin_port));
    options_.bucket = "b";
    options_.access_key_id = options_.secret_access_key = "k";
    thread_ = std::thread([this, answers = std::move(answers)] {
      for (const std::string& answer : answers) {
        const int connection = ::accept(socket_, nullptr, nullptr);
        if (connection < 0) return;
        std::string request;
        char c = 0;
        while (request.find("\r\n\r\n") == std::string::npos && ::read(connection, &c, 1) == 1) request += c;
        ++requests_;
        EXPECT_EQ(::write(connection, answer.data(), answer.size()), static_cast<ssize_t>(answer.size()));
        ::close(connection);
      }
    });
  }
  ~ScriptedServer() {
    ::shutdown(socket_, SHUT_RDWR);
    thread_.join();
    ::close(socket_);
  }
  const S3Options& options() const { return options_; }
  int requests() const { return requests_; }

  static std::string Answer(const std::string& status, const std::string& body) {
    return absl::StrCat("HTTP/1.1 ", status, "\r\nConnection: close\r\nContent-Length: ", body.size(), "\r\n\r\n",
                        body);
  }

 private:
  S3Options options_;
  const int socket_;
  std::atomic<int> requests_{0};
  std::thread thread_;
};

TEST(S3ClientTest, BusyServersAndBrokenConnectionsAreTriedAgain) {
  const std::string cut = "HTTP/1.1 200 OK\r\nConnection: close\r\nContent-Length: 100\r\n\r\nonly the beginning";
  ScriptedServer server({ScriptedServer::Answer("503 Slow Down", "<Error><Code>SlowDown</Code></Error>"), "", cut,
                         ScriptedServer::Answer("200 OK", "all of it")});
  S3Client client(server.options());
  const auto response = client.Send({.method = "GET", .key = "k"});
  ASSERT_TRUE(response.ok()) << response.status();
  EXPECT_EQ(response->body, "all of it");
  EXPECT_EQ(server.requests(), 4);
}

TEST(S3ClientTest, TheRetryDeadlineEnds) {
  S3Options options = ScriptedServer({}).options();  // nobody listens there any more
  options.retry_deadline = absl::Milliseconds(300);
  S3Client client(options);
  const absl::Status status = client.Send({.method = "GET", .key = "k"}).status();
  EXPECT_TRUE(absl::IsUnavailable(status)) << status;
  EXPECT_THAT(status.ToString(), HasSubstr(options.endpoint + "/b/k"));
}

TEST(S3ClientTest, RefusalsAreNotTriedAgain) {
  ScriptedServer server({ScriptedServer::Answer(
      "403 Forbidden", "<Error><Code>AccessDenied</Code><Message>Access Denied</Message></Error>")});
  S3Client client(server.options());
  const absl::Status status = client.Send({.method = "GET", .key = "k"}).status();
  EXPECT_TRUE(absl::IsPermissionDenied(status)) << status;
  EXPECT_THAT(status.ToString(), HasSubstr("AccessDenied"));
}

TEST(S3CredentialsTest, ComeFromTheEnvironment) {
  ::setenv("AWS_ACCESS_KEY_ID", "id", 1);
  ::setenv("AWS_SECRET_ACCESS_KEY", "secret", 1);
  ::unsetenv("AWS_SESSION_TOKEN");
  S3Options options;
  ASSERT_TRUE(ReadS3Credentials(&options).ok());
  EXPECT_EQ(options.access_key_id, "id");
  EXPECT_EQ(options.secret_access_key, "secret");
  ::unsetenv("AWS_SECRET_ACCESS_KEY");
  EXPECT_TRUE(absl::IsFailedPrecondition(ReadS3Credentials(&options)));
}

}  // namespace
}  // namespace meshwright
