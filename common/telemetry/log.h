// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "common/base/clock.h"

namespace meshwright {

using LogValue = std::variant<int64_t, double, std::string>;
// In the order in which they are written. The names that programs share: reconstruction, camera, sequence, attempt,
// worker, seconds, error.
using LogFields = std::vector<std::pair<std::string, LogValue>>;

enum class LogLevel { kInfo, kWarning, kError };

// What long-running programs say about themselves, one line an event. Thread-safe; copies write to the same place.
class Logger {
 public:
  enum class Format {
    kText,  // 2026-01-31T12:00:00.000Z info    job finished  camera=3 seconds=1.5
    kJson,  // {"time":"2026-01-31T12:00:00.000Z","level":"info","message":"job finished","camera":3,"seconds":1.5}
  };
  // Gets whole lines without their end, one call at a time.
  using Sink = std::function<void(const std::string& line)>;

  Logger(Format format, const Clock& clock, Sink sink);
  // Text when stderr is a terminal, otherwise JSON.
  static Logger ToStderr();
  // For those who do not want to hear anything.
  static Logger Nowhere();

  // A logger that adds `fields` to each line.
  Logger With(const LogFields& fields) const;

  void Info(const std::string& message, const LogFields& fields = {}) const;
  void Warning(const std::string& message, const LogFields& fields = {}) const;
  void Error(const std::string& message, const LogFields& fields = {}) const;

 private:
  void Log(LogLevel level, const std::string& message, const LogFields& fields) const;

  Format format_;
  const Clock* clock_;
  Sink sink_;
  LogFields always_;
};

}  // namespace meshwright
