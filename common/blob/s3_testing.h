// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>

#include <absl/status/statusor.h>

#include "common/blob/s3_client.h"

namespace meshwright {

// A real S3 server of the test's own (tests/s3), with an empty bucket; gone with the object, or with the process.
class S3Server {
 public:
  // NotFound, saying why, where the server cannot be had: no node, no npm, no registry.
  static absl::StatusOr<std::unique_ptr<S3Server>> Start();
  S3Server(const S3Server&) = delete;
  S3Server& operator=(const S3Server&) = delete;
  ~S3Server();

  // How to reach it; every call has a prefix of its own.
  S3Options NewOptions();
  // Where an object's bytes lie.
  std::string FileOf(const S3Options& options, const std::string& key) const;

 private:
  S3Server() = default;
  std::string folder_;
  std::string endpoint_;
  int socket_ = -1;  // the server's standard input and output
  int process_ = -1;
  int prefixes_ = 0;
};

}  // namespace meshwright
