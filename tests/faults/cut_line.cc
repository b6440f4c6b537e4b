// SPDX-License-Identifier: Apache-2.0
#include "tests/faults/cut_line.h"

#include <algorithm>
#include <array>

#include <arpa/inet.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include "common/base/check.h"

namespace meshwright::faults {
namespace {

sockaddr_in Loopback(int port) {
  sockaddr_in address = {};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  address.sin_port = htons(static_cast<uint16_t>(port));
  return address;
}

bool WriteAll(int to, const char* bytes, ssize_t count) {
  while (count > 0) {
    const ssize_t written = ::send(to, bytes, static_cast<size_t>(count), MSG_NOSIGNAL);
    if (written <= 0) return false;
    bytes += written;
    count -= written;
  }
  return true;
}

}  // namespace

CutLine::CutLine(int to_port) : to_port_(to_port), listener_(::socket(AF_INET, SOCK_STREAM, 0)) {
  sockaddr_in address = Loopback(0);
  socklen_t size = sizeof(address);
  MW_CHECK(::bind(listener_, reinterpret_cast<sockaddr*>(&address), size) == 0);
  MW_CHECK(::listen(listener_, 16) == 0);
  MW_CHECK(::getsockname(listener_, reinterpret_cast<sockaddr*>(&address), &size) == 0);
  port_ = ntohs(address.sin_port);
  thread_ = std::thread([this] { Run(); });
}

CutLine::~CutLine() {
  stopping_ = true;
  thread_.join();
  ::close(listener_);
}

std::string CutLine::address() const { return "127.0.0.1:" + std::to_string(port_); }

void CutLine::Mend() {
  mend_ = true;
  while (mend_ && !stopping_) ::usleep(1000);
}

void CutLine::Run() {
  while (!stopping_) {
    if (mend_) {
      CloseAll();
      cut_ = false;
      mend_ = false;
    }
    if (cut_) {
      ::usleep(10'000);
      continue;
    }
    std::vector<pollfd> watched = {{listener_, POLLIN, 0}};
    for (const Connection& connection : connections_) {
      watched.push_back({connection.near, POLLIN, 0});
      watched.push_back({connection.far, POLLIN, 0});
    }
    if (::poll(watched.data(), watched.size(), 20) <= 0 || cut_) continue;
    for (size_t i = connections_.size(); i-- > 0;) {
      const Connection connection = connections_[i];
      const bool alive = (watched[2 * i + 1].revents == 0 || Carry(connection.near, connection.far)) &&
                         (watched[2 * i + 2].revents == 0 || Carry(connection.far, connection.near));
      if (alive) continue;
      ::close(connection.near);
      ::close(connection.far);
      connections_.erase(connections_.begin() + static_cast<int64_t>(i));
    }
    if (watched[0].revents != 0) Accept();
  }
  CloseAll();
}

void CutLine::Accept() {
  Connection connection;
  connection.near = ::accept(listener_, nullptr, nullptr);
  if (connection.near < 0) return;
  connection.far = ::socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in address = Loopback(to_port_);
  if (::connect(connection.far, reinterpret_cast<sockaddr*>(&address), sizeof(address)) != 0) {
    ::close(connection.near);
    ::close(connection.far);
    return;
  }
  connections_.push_back(connection);
}

bool CutLine::Carry(int from, int to) {
  std::array<char, 65536> bytes = {};
  const ssize_t count = ::recv(from, bytes.data(), bytes.size(), 0);
  return count > 0 && WriteAll(to, bytes.data(), count);
}

void CutLine::CloseAll() {
  for (const Connection& connection : connections_) {
    ::close(connection.near);
    ::close(connection.far);
  }
  connections_.clear();
}

}  // namespace meshwright::faults
