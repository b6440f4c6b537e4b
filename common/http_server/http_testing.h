// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include <absl/status/status.h>

namespace meshwright {

// A client that sends the very bytes it is told to. Checks that it can connect.
class RawClient {
 public:
  // `from`: the address to connect from, on a machine where all of 127/8 is its own.
  explicit RawClient(int port, const std::string& from = "127.0.0.1");
  RawClient(RawClient&& other) noexcept;
  RawClient& operator=(RawClient&&) = delete;
  RawClient(const RawClient&) = delete;
  ~RawClient();

  // False when the server has closed the connection.
  bool Send(const std::string& bytes) const;
  // What comes until there are `count` bytes, `until` is part of it, the connection is closed, or `seconds` are over.
  std::string Read(double seconds, const std::string& until = "", size_t count = size_t(-1)) const;
  // Whether the server closes the connection within `seconds`; what it sends until then is dropped.
  bool IsClosedWithin(double seconds) const;
  void ShrinkReceiveBuffer() const;

 private:
  int socket_;
};

// Seconds that a request from another connection takes; 1e9 when it is not answered with 200.
double SecondsOf(int port, const std::string& path, const std::string& from = "127.0.0.1");

// "HTTP/1.1 " behind one another: how many answers there are.
size_t CountAnswers(const std::string& text);

// Of this process.
double ResidentMebibytes();
int ThreadCount();

// Writes a self-signed certificate for `name` and its key, both in PEM.
absl::Status WriteTestCertificate(const std::string& name, const std::string& certificate_file,
                                  const std::string& key_file);

}  // namespace meshwright
