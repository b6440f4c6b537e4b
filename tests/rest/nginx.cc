// SPDX-License-Identifier: Apache-2.0
#include "tests/rest/nginx.h"

#include <chrono>
#include <csignal>
#include <filesystem>
#include <thread>

#include <absl/strings/str_cat.h>
#include <arpa/inet.h>
#include <netinet/in.h>
#include <spawn.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include "common/base/check.h"
#include "common/base/files.h"
#include "common/base/status_macros.h"

extern char** environ;

namespace meshwright {
namespace {

constexpr char kProgram[] = "/usr/sbin/nginx";

sockaddr_in Loopback(int port) {
  sockaddr_in address = {};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<uint16_t>(port));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  return address;
}

int FreePort() {
  const int descriptor = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in address = Loopback(0);
  socklen_t size = sizeof(address);
  MW_CHECK(::bind(descriptor, reinterpret_cast<sockaddr*>(&address), size) == 0);
  MW_CHECK(::getsockname(descriptor, reinterpret_cast<sockaddr*>(&address), &size) == 0);
  ::close(descriptor);
  return ntohs(address.sin_port);
}

bool Listens(int port) {
  const int descriptor = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  const sockaddr_in address = Loopback(port);
  const bool connected = ::connect(descriptor, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) == 0;
  ::close(descriptor);
  return connected;
}

std::string ServerBlock(int port, const char* buffering) {
  return absl::StrCat("  server {\n    listen 127.0.0.1:", port,
                      ";\n    client_max_body_size 0;\n    location / {\n      proxy_pass http://behind;\n"
                      "      proxy_http_version 1.1;\n      proxy_set_header Connection \"\";\n"
                      "      proxy_set_header X-Forwarded-For $proxy_add_x_forwarded_for;\n"
                      "      proxy_request_buffering ",
                      buffering, ";\n    }\n  }\n");
}

}  // namespace

absl::StatusOr<std::unique_ptr<Nginx>> Nginx::Start(const std::string& folder, int server_port) {
  if (!std::filesystem::exists(kProgram)) return absl::NotFoundError("nginx is not installed (Debian package nginx)");
  auto nginx = std::unique_ptr<Nginx>(new Nginx());
  nginx->buffering_port_ = FreePort();
  nginx->streaming_port_ = FreePort();
  std::string paths;
  for (const char* kind : {"client_body", "proxy", "fastcgi", "uwsgi", "scgi"}) {
    absl::StrAppend(&paths, "  ", kind, "_temp_path ", folder, "/", kind, ";\n");
  }
  // One process and one kept connection: each request follows the one before.
  const std::string config =
      absl::StrCat("daemon off;\nmaster_process off;\npid ", folder, "/pid;\nerror_log ", folder,
                   "/error.log;\nevents {}\nhttp {\n  access_log off;\n", paths,
                   "  upstream behind {\n    server 127.0.0.1:", server_port, ";\n    keepalive 1;\n  }\n",
                   ServerBlock(nginx->buffering_port_, "on"), ServerBlock(nginx->streaming_port_, "off"), "}\n");
  const std::string file = folder + "/nginx.conf";
  MW_RETURN_IF_ERROR(WriteFileAtomically(file, config));
  const std::string log = folder + "/error.log";
  const char* const arguments[] = {kProgram, "-p", folder.c_str(), "-c", file.c_str(), "-e", log.c_str(), nullptr};
  MW_CHECK(::posix_spawn(&nginx->process_, kProgram, nullptr, nullptr, const_cast<char**>(arguments), environ) == 0);
  for (int i = 0; i < 500; ++i) {
    if (Listens(nginx->buffering_port_) && Listens(nginx->streaming_port_)) return nginx;
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  return absl::InternalError(absl::StrCat("nginx does not listen: ", ReadFile(log).value_or("no log")));
}

Nginx::~Nginx() {
  if (process_ <= 0) return;
  ::kill(process_, SIGKILL);
  ::waitpid(process_, nullptr, 0);
}

}  // namespace meshwright
