// SPDX-License-Identifier: Apache-2.0
#include "common/telemetry/metrics.h"

#include <cmath>
#include <utility>

#include <absl/strings/ascii.h>
#include <absl/strings/str_cat.h>
#include <prometheus/text_serializer.h>

#include "common/base/version.h"
#include "common/telemetry/process_metrics.h"

namespace meshwright {
namespace {

constexpr double kFastestCallSeconds = 1e-4;
constexpr double kSlowestCallSeconds = 50;

}  // namespace

Metrics::Metrics(const std::string& program) : process_({std::make_shared<ProcessMetrics>()}) {
  Gauge("meshwright_build_info", "Always 1; its labels say which program of which version this is.",
        {{"program", program}, {"version", kProgramVersion}})
      .Set(1);
}

prometheus::Counter& Metrics::Counter(const std::string& name, const std::string& help,
                                      const prometheus::Labels& labels) {
  return prometheus::BuildCounter().Name(name).Help(help).Register(registry_).Add(labels);
}

prometheus::Gauge& Metrics::Gauge(const std::string& name, const std::string& help, const prometheus::Labels& labels) {
  return prometheus::BuildGauge().Name(name).Help(help).Register(registry_).Add(labels);
}

prometheus::Histogram& Metrics::Histogram(const std::string& name, const std::string& help,
                                          const std::vector<double>& bucket_bounds, const prometheus::Labels& labels) {
  return prometheus::BuildHistogram().Name(name).Help(help).Register(registry_).Add(labels, bucket_bounds);
}

void Metrics::BeforeEachScrape(std::function<void()> refresh) {
  const MutexLock lock(scraping_);
  refreshes_.push_back(std::move(refresh));
}

std::string Metrics::Text() const {
  const MutexLock lock(scraping_);
  for (const auto& refresh : refreshes_) refresh();
  std::vector<prometheus::MetricFamily> families = registry_.Collect();
  for (const auto& process : process_) {
    for (auto& family : process->Collect()) families.push_back(std::move(family));
  }
  return prometheus::TextSerializer().Serialize(families);
}

std::vector<double> BucketBounds(double first, double last) {
  std::vector<double> bounds;
  const int from = static_cast<int>(std::floor(std::log10(first) + 1e-9));
  const int to = static_cast<int>(std::ceil(std::log10(last) - 1e-9));
  for (int decade = from; decade <= to; ++decade) {
    for (const double digit : {1.0, 2.0, 5.0}) {
      // Division where the power is negative: 5 / 1000 is the number that "0.005" reads as, 5 * 1e-3 need not be.
      const double bound = decade < 0 ? digit / std::pow(10.0, -decade) : digit * std::pow(10.0, decade);
      if (bound >= first * (1 - 1e-9) && bound <= last * (1 + 1e-9)) bounds.push_back(bound);
    }
  }
  return bounds;
}

CallMetrics::CallMetrics(Metrics& metrics, std::string prefix, std::string what)
    : metrics_(metrics),
      prefix_(std::move(prefix)),
      what_(std::move(what)),
      bounds_(BucketBounds(kFastestCallSeconds, kSlowestCallSeconds)) {}

void CallMetrics::Record(const std::string& operation, absl::Duration took, const absl::Status& status) {
  // The registry finds what is there already, under its lock: microseconds, beside calls to disks and networks.
  metrics_
      .Histogram(absl::StrCat(prefix_, "_seconds"), absl::StrCat(what_, ": how long they took."), bounds_,
                 {{"operation", operation}})
      .Observe(absl::ToDoubleSeconds(took));
  if (status.ok()) return;
  metrics_
      .Counter(absl::StrCat(prefix_, "_errors_total"), absl::StrCat(what_, " that failed."),
               {{"operation", operation}, {"code", absl::AsciiStrToLower(absl::StatusCodeToString(status.code()))}})
      .Increment();
}

}  // namespace meshwright
