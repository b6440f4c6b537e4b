// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include <absl/status/statusor.h>
#include <absl/time/time.h>
#include <boost/asio/ssl/context.hpp>

namespace meshwright {

// A certificate and its key, read again when the files change, so that they can be renewed while the server runs. Not
// thread-safe.
class TlsFiles {
 public:
  using Context = boost::asio::ssl::context;

  // InvalidArgument names the file that is wrong.
  static absl::StatusOr<std::unique_ptr<TlsFiles>> Open(const std::string& certificate_file,
                                                        const std::string& key_file,
                                                        std::function<void(const std::string&)> warn);

  // For a new connection. Files that do not fit together are told once by `warn`; what was good last stays in use.
  std::shared_ptr<Context> Current();

 private:
  // Tells whether one of the files is another one: device, inode, size and time of each.
  using Stamp = std::array<int64_t, 10>;
  TlsFiles(std::string certificate_file, std::string key_file, std::function<void(const std::string&)> warn);
  absl::StatusOr<std::shared_ptr<Context>> Load() const;
  Stamp StampNow() const;

  const std::string certificate_file_;
  const std::string key_file_;
  const std::function<void(const std::string&)> warn_;
  std::shared_ptr<Context> context_;
  Stamp stamp_ = {};  // of the files when they were last read
};

}  // namespace meshwright
