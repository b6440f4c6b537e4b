// SPDX-License-Identifier: Apache-2.0
#include "tests/scale/event_listeners.h"

#include <array>
#include <cerrno>

#include <absl/strings/str_cat.h>
#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include "common/base/check.h"

namespace meshwright::scale {
namespace {

constexpr int kPollMs = 50;
constexpr size_t kReadBytes = 64 << 10;

// One caller gets 250 streams: these come from many addresses, as from many browsers.
constexpr int kStreamsOfOneAddress = 200;

int Connect(const std::string& port, int number) {
  const int connected = ::socket(AF_INET, SOCK_STREAM, 0);
  MW_CHECK(connected >= 0);
  sockaddr_in own = {};
  own.sin_family = AF_INET;
  own.sin_addr.s_addr = htonl(INADDR_LOOPBACK + 256 + static_cast<uint32_t>(number / kStreamsOfOneAddress));
  MW_CHECK(::bind(connected, reinterpret_cast<sockaddr*>(&own), sizeof(own)) == 0);
  sockaddr_in address = {};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<uint16_t>(std::stoi(port)));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  MW_CHECK(::connect(connected, reinterpret_cast<sockaddr*>(&address), sizeof(address)) == 0);
  return connected;
}

}  // namespace

EventListeners::EventListeners(const std::string& port, const std::string& reconstruction, int clients) {
  const std::string request =
      absl::StrCat("GET /v1/reconstructions/", reconstruction, "/events HTTP/1.1\r\nHost: localhost\r\n\r\n");
  for (int i = 0; i < clients; ++i) {
    clients_.push_back({.socket = Connect(port, i)});
    MW_CHECK(::send(clients_.back().socket, request.data(), request.size(), 0) == static_cast<ssize_t>(request.size()));
  }
  thread_ = std::thread([this] { Run(); });
}

EventListeners::~EventListeners() {
  stopping_ = true;
  thread_.join();
  for (const Client& client : clients_) {
    if (client.socket >= 0) ::close(client.socket);
  }
}

void EventListeners::Run() {
  std::vector<pollfd> waiting(clients_.size());
  for (size_t i = 0; i < clients_.size(); ++i) waiting[i] = {.fd = clients_[i].socket, .events = POLLIN, .revents = 0};
  while (!stopping_) {
    ::poll(waiting.data(), waiting.size(), kPollMs);
    for (size_t i = 0; i < clients_.size(); ++i) {
      if (waiting[i].revents == 0 || Read(clients_[i])) continue;
      if (!clients_[i].has_ended) ++dropped_;
      ::close(clients_[i].socket);
      clients_[i].socket = -1;
      waiting[i].fd = -1;
    }
  }
}

// False: the server closed the connection, or has said everything.
bool EventListeners::Read(Client& client) {
  static thread_local std::array<char, kReadBytes> buffer;
  const ssize_t count = ::recv(client.socket, buffer.data(), buffer.size(), MSG_DONTWAIT);
  if (count < 0) return errno == EAGAIN || errno == EINTR;
  if (count == 0) return false;
  bytes_ += count;
  for (ssize_t i = 0; i < count; ++i) {
    if (buffer[i] != '\n') {
      // Lines that count are short; of the others the beginning is enough.
      if (client.line.size() < 16) client.line += buffer[i];
      continue;
    }
    if (client.line == "event: part") ++parts_;
    if (client.line == "event: end") client.has_ended = true;
    client.line.clear();
  }
  return !client.has_ended;
}

}  // namespace meshwright::scale
