// SPDX-License-Identifier: Apache-2.0
#include "common/blob/s3_testing.h"

#include <cstdlib>
#include <filesystem>
#include <system_error>

#include <absl/strings/str_cat.h>
#include <fcntl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include "common/base/check.h"

namespace meshwright {
namespace {

constexpr const char* kBucket = "meshwright";

std::string ReadLine(int socket) {
  std::string line;
  char c = 0;
  while (::read(socket, &c, 1) == 1 && c != '\n') line += c;
  return line;
}

}  // namespace

absl::StatusOr<std::unique_ptr<S3Server>> S3Server::Start() {
  std::unique_ptr<S3Server> server(new S3Server());
  std::string folder = (std::filesystem::temp_directory_path() / "meshwright-s3-XXXXXX").string();
  MW_CHECK(mkdtemp(folder.data()) != nullptr);
  server->folder_ = folder;
  int ends[2];
  MW_CHECK(::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) == 0);
  server->socket_ = ends[0];
  const std::string program = MW_SOURCE_FOLDER "/tests/s3/start-s3-server";
  server->process_ = ::fork();
  MW_CHECK(server->process_ >= 0);
  if (server->process_ == 0) {
    ::dup2(ends[1], STDIN_FILENO);
    ::dup2(ends[1], STDOUT_FILENO);
    ::execl(program.c_str(), program.c_str(), MW_S3_INSTALL_FOLDER, folder.c_str(), nullptr);
    ::_exit(127);
  }
  ::close(ends[1]);
  const std::string line = ReadLine(server->socket_);
  if (line.rfind("http://", 0) != 0) {
    return absl::NotFoundError(absl::StrCat("no S3 server to test with: ", line));
  }
  server->endpoint_ = line;
  return server;
}

S3Server::~S3Server() {
  ::close(socket_);
  ::waitpid(process_, nullptr, 0);
  std::error_code ignored;
  std::filesystem::remove_all(folder_, ignored);
}

S3Options S3Server::NewOptions() {
  S3Options options;
  options.endpoint = endpoint_;
  options.bucket = kBucket;
  options.prefix = absl::StrCat("test/", prefixes_++, "/");
  options.access_key_id = "S3RVER";
  options.secret_access_key = "S3RVER";
  return options;
}

std::string S3Server::FileOf(const S3Options& options, const std::string& key) const {
  return absl::StrCat(folder_, "/", kBucket, "/", options.prefix, key, "._S3rver_object");
}

}  // namespace meshwright
