// SPDX-License-Identifier: Apache-2.0
#include "common/telemetry/log.h"

#include <cstdio>
#include <memory>
#include <mutex>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/time/time.h>
#include <nlohmann/json.hpp>
#include <unistd.h>

#include "common/json/json_text.h"

namespace meshwright {
namespace {

const char* NameOf(LogLevel level) {
  switch (level) {
    case LogLevel::kInfo:
      return "info";
    case LogLevel::kWarning:
      return "warning";
    case LogLevel::kError:
      return "error";
  }
  return "";
}

nlohmann::ordered_json ToJson(const LogValue& value) {
  return std::visit([](const auto& held) { return nlohmann::ordered_json(held); }, value);
}

std::string ToText(const LogValue& value) {
  const auto* const text = std::get_if<std::string>(&value);
  const bool plain = text == nullptr || (!text->empty() && text->find_first_of(" \t\r\n\"=\\") == std::string::npos);
  return text != nullptr && plain ? *text : JsonText(ToJson(value));
}

}  // namespace

Logger::Logger(Format format, const Clock& clock, Sink sink)
    : format_(format),
      clock_(&clock),
      sink_([sink = std::move(sink), mutex = std::make_shared<std::mutex>()](const std::string& line) {
        const std::lock_guard<std::mutex> lock(*mutex);
        sink(line);
      }) {}

Logger Logger::ToStderr() {
  const Format format = ::isatty(STDERR_FILENO) != 0 ? Format::kText : Format::kJson;
  // One write a line: several processes may share the stream.
  return {format, SystemClock(), [](const std::string& line) { std::fputs((line + "\n").c_str(), stderr); }};
}

Logger Logger::Nowhere() {
  return {Format::kJson, SystemClock(), [](const std::string&) {}};
}

Logger Logger::With(const LogFields& fields) const {
  Logger logger = *this;
  logger.always_.insert(logger.always_.end(), fields.begin(), fields.end());
  return logger;
}

void Logger::Info(const std::string& message, const LogFields& fields) const { Log(LogLevel::kInfo, message, fields); }

void Logger::Warning(const std::string& message, const LogFields& fields) const {
  Log(LogLevel::kWarning, message, fields);
}

void Logger::Error(const std::string& message, const LogFields& fields) const {
  Log(LogLevel::kError, message, fields);
}

void Logger::Log(LogLevel level, const std::string& message, const LogFields& fields) const {
  const std::string time = absl::FormatTime("%Y-%m-%d%ET%H:%M:%E3SZ", clock_->Now(), absl::UTCTimeZone());
  if (format_ == Format::kJson) {
    nlohmann::ordered_json line = {{"time", time}, {"level", NameOf(level)}, {"message", message}};
    for (const LogFields* const some : {&always_, &fields}) {
      for (const auto& [name, value] : *some) line[name] = ToJson(value);
    }
    sink_(JsonText(line));
    return;
  }
  std::string line = absl::StrFormat("%s %-7s %s", time, NameOf(level), message);
  for (const LogFields* const some : {&always_, &fields}) {
    for (const auto& [name, value] : *some) absl::StrAppend(&line, "  ", name, "=", ToText(value));
  }
  // A message may hold what somebody else sent: a line stays a line.
  for (char& c : line) {
    if (c == '\n' || c == '\r') c = ' ';
  }
  sink_(line);
}

}  // namespace meshwright
