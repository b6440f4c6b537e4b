// SPDX-License-Identifier: Apache-2.0
#include "common/telemetry/process_metrics.h"

#include <filesystem>
#include <fstream>
#include <iterator>
#include <optional>
#include <sstream>
#include <string>

#include <sys/resource.h>
#include <unistd.h>

#include "common/base/process_usage.h"

namespace meshwright {
namespace {

using prometheus::MetricFamily;
using prometheus::MetricType;

MetricFamily Family(const std::string& name, const std::string& help, MetricType type, double value) {
  prometheus::ClientMetric metric;
  if (type == MetricType::Counter) {
    metric.counter.value = value;
  } else {
    metric.gauge.value = value;
  }
  return {name, help, type, {metric}};
}

std::string ReadWhole(const char* path) {
  std::ifstream file(path);
  return {std::istreambuf_iterator<char>(file), {}};
}

// Fields of /proc/self/stat that proc(5) numbers from 1, behind the program's name, which may hold anything.
struct ProcessStat {
  double threads = 0;         // (20)
  double start_ticks = 0;     // (22) since boot
  double resident_pages = 0;  // (24)
};

std::optional<ProcessStat> ReadStat() {
  const std::string text = ReadWhole("/proc/self/stat");
  const size_t name_end = text.rfind(')');
  if (name_end == std::string::npos) return std::nullopt;
  std::istringstream words(text.substr(name_end + 1));
  ProcessStat stat;
  std::string word;
  constexpr int kFirstField = 3;
  for (int field = kFirstField; words >> word; ++field) {
    if (field == 20) stat.threads = std::stod(word);
    if (field == 22) stat.start_ticks = std::stod(word);
    if (field == 24) {
      stat.resident_pages = std::stod(word);
      return stat;
    }
  }
  return std::nullopt;
}

std::optional<double> BootTimeSeconds() {
  std::istringstream lines(ReadWhole("/proc/stat"));
  for (std::string line; std::getline(lines, line);) {
    if (line.rfind("btime ", 0) == 0) return std::stod(line.substr(6));
  }
  return std::nullopt;
}

}  // namespace

std::vector<MetricFamily> ProcessMetrics::Collect() const {
  std::vector<MetricFamily> families;
  families.push_back(Family("process_cpu_seconds_total", "User and system CPU time.", MetricType::Counter,
                            MeasureProcessUsage().cpu_seconds));
  if (const auto stat = ReadStat()) {
    families.push_back(Family("process_resident_memory_bytes", "Memory that is in RAM.", MetricType::Gauge,
                              stat->resident_pages * static_cast<double>(::sysconf(_SC_PAGESIZE))));
    families.push_back(Family("process_threads", "Threads.", MetricType::Gauge, stat->threads));
    if (const auto boot = BootTimeSeconds()) {
      families.push_back(Family("process_start_time_seconds", "When it was started, Unix time.", MetricType::Gauge,
                                *boot + stat->start_ticks / static_cast<double>(::sysconf(_SC_CLK_TCK))));
    }
  }
  std::error_code error;
  double open = 0;
  for (std::filesystem::directory_iterator it("/proc/self/fd", error), end; !error && it != end; it.increment(error)) {
    ++open;
  }
  if (!error) {
    families.push_back(Family("process_open_fds", "Open file descriptors.", MetricType::Gauge, open));
  }
  rlimit limit{};
  if (::getrlimit(RLIMIT_NOFILE, &limit) == 0) {
    families.push_back(Family("process_max_fds", "Most file descriptors that may be open.", MetricType::Gauge,
                              static_cast<double>(limit.rlim_cur)));
  }
  return families;
}

}  // namespace meshwright
