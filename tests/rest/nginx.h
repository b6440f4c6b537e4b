// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>

#include <absl/status/statusor.h>

namespace meshwright {

// nginx in front of a server, with connections to it that are kept: one port hands bodies on when they are there whole,
// the other one as they come.
class Nginx {
 public:
  // `folder` is empty and there. NotFound where nginx is not installed.
  static absl::StatusOr<std::unique_ptr<Nginx>> Start(const std::string& folder, int server_port);
  Nginx(const Nginx&) = delete;
  Nginx& operator=(const Nginx&) = delete;
  ~Nginx();

  int buffering_port() const { return buffering_port_; }
  int streaming_port() const { return streaming_port_; }

 private:
  Nginx() = default;
  int process_ = -1;
  int buffering_port_ = 0;
  int streaming_port_ = 0;
};

}  // namespace meshwright
