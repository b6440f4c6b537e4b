// SPDX-License-Identifier: Apache-2.0
#include "common/http_server/http_testing.h"

#include <cerrno>
#include <cstdio>
#include <fstream>
#include <memory>
#include <utility>

#include <arpa/inet.h>
#include <netinet/in.h>
#include <openssl/evp.h>
#include <openssl/pem.h>
#include <openssl/x509.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include "common/base/check.h"
#include "common/base/clock.h"

namespace meshwright {
namespace {

sockaddr_in AddressOf(const std::string& host, int port) {
  sockaddr_in address = {};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<uint16_t>(port));
  MW_CHECK(::inet_pton(AF_INET, host.c_str(), &address.sin_addr) == 1);
  return address;
}

double StatusNumber(const char* name) {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);) {
    if (line.rfind(name, 0) == 0) return std::stod(line.substr(line.find(':') + 1));
  }
  return 0;
}

}  // namespace

RawClient::RawClient(int port, const std::string& from) : socket_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
  MW_CHECK(socket_ >= 0);
  const sockaddr_in own = AddressOf(from, 0);
  const sockaddr_in server = AddressOf("127.0.0.1", port);
  MW_CHECK(::bind(socket_, reinterpret_cast<const sockaddr*>(&own), sizeof(own)) == 0);
  MW_CHECK(::connect(socket_, reinterpret_cast<const sockaddr*>(&server), sizeof(server)) == 0);
}

RawClient::RawClient(RawClient&& other) noexcept : socket_(std::exchange(other.socket_, -1)) {}

RawClient::~RawClient() {
  if (socket_ >= 0) ::close(socket_);
}

bool RawClient::Send(const std::string& bytes) const {
  for (size_t sent = 0; sent < bytes.size();) {
    const ssize_t count = ::send(socket_, bytes.data() + sent, bytes.size() - sent, MSG_NOSIGNAL);
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) return false;
    sent += static_cast<size_t>(count);
  }
  return true;
}

std::string RawClient::Read(double seconds, const std::string& until, size_t count) const {
  const Stopwatch stopwatch;
  std::string text;
  while (text.size() < count && (until.empty() || text.find(until) == std::string::npos)) {
    const double left = seconds - stopwatch.Seconds();
    pollfd event = {.fd = socket_, .events = POLLIN, .revents = 0};
    if (left <= 0 || ::poll(&event, 1, static_cast<int>(left * 1000) + 1) <= 0) break;
    char piece[65536];
    const ssize_t got = ::recv(socket_, piece, sizeof(piece), 0);
    if (got <= 0) break;
    text.append(piece, static_cast<size_t>(got));
  }
  return text;
}

bool RawClient::IsClosedWithin(double seconds) const {
  const Stopwatch stopwatch;
  while (stopwatch.Seconds() < seconds) {
    pollfd event = {.fd = socket_, .events = POLLIN, .revents = 0};
    if (::poll(&event, 1, 20) <= 0) continue;
    char piece[65536];
    if (::recv(socket_, piece, sizeof(piece), 0) <= 0) return true;
  }
  return false;
}

void RawClient::ShrinkReceiveBuffer() const {
  const int bytes = 4096;
  MW_CHECK(::setsockopt(socket_, SOL_SOCKET, SO_RCVBUF, &bytes, sizeof(bytes)) == 0);
}

double SecondsOf(int port, const std::string& path, const std::string& from) {
  const Stopwatch stopwatch;
  const RawClient client(port, from);
  client.Send("GET " + path + " HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n");
  const std::string answer = client.Read(30);
  return answer.rfind("HTTP/1.1 200", 0) == 0 ? stopwatch.Seconds() : 1e9;
}

size_t CountAnswers(const std::string& text) {
  size_t count = 0;
  for (size_t at = text.find("HTTP/1.1 "); at != std::string::npos; at = text.find("HTTP/1.1 ", at + 1)) ++count;
  return count;
}

double ResidentMebibytes() { return StatusNumber("VmRSS:") / 1024; }

int ThreadCount() { return static_cast<int>(StatusNumber("Threads:")); }

absl::Status WriteTestCertificate(const std::string& name, const std::string& certificate_file,
                                  const std::string& key_file) {
  const std::unique_ptr<EVP_PKEY, void (*)(EVP_PKEY*)> key(EVP_EC_gen("P-256"), EVP_PKEY_free);
  const std::unique_ptr<X509, void (*)(X509*)> certificate(X509_new(), X509_free);
  MW_CHECK(key != nullptr && certificate != nullptr);
  X509_set_version(certificate.get(), 2);
  ASN1_INTEGER_set(X509_get_serialNumber(certificate.get()), 1);
  X509_gmtime_adj(X509_getm_notBefore(certificate.get()), -3600);
  X509_gmtime_adj(X509_getm_notAfter(certificate.get()), 3600);
  X509_NAME* subject = X509_get_subject_name(certificate.get());
  X509_NAME_add_entry_by_txt(subject, "CN", MBSTRING_ASC, reinterpret_cast<const unsigned char*>(name.c_str()), -1, -1,
                             0);
  X509_set_issuer_name(certificate.get(), subject);
  X509_set_pubkey(certificate.get(), key.get());
  MW_CHECK(X509_sign(certificate.get(), key.get(), EVP_sha256()) > 0);
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> to_certificate(std::fopen(certificate_file.c_str(), "w"),
                                                                       std::fclose);
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> to_key(std::fopen(key_file.c_str(), "w"), std::fclose);
  if (to_certificate == nullptr || to_key == nullptr) return absl::PermissionDeniedError("cannot write a certificate");
  MW_CHECK(PEM_write_X509(to_certificate.get(), certificate.get()) == 1);
  MW_CHECK(PEM_write_PrivateKey(to_key.get(), key.get(), nullptr, nullptr, 0, nullptr, nullptr) == 1);
  return absl::OkStatus();
}

}  // namespace meshwright
