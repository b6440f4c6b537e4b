// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <absl/status/status.h>
#include <absl/time/time.h>
#include <prometheus/collectable.h>
#include <prometheus/counter.h>
#include <prometheus/gauge.h>
#include <prometheus/histogram.h>
#include <prometheus/registry.h>

#include "common/base/mutex.h"

namespace meshwright {

// Everything that one program tells Prometheus, by its conventions: base units, names that begin with meshwright_,
// "_total" behind counters. Labels have few values: never a reconstruction, a camera or a worker's name. Thread-safe.
class Metrics {
 public:
  // `program`: "coordinator" or "worker", told with the version by meshwright_build_info.
  explicit Metrics(const std::string& program);

  prometheus::Counter& Counter(const std::string& name, const std::string& help, const prometheus::Labels& labels = {});
  prometheus::Gauge& Gauge(const std::string& name, const std::string& help, const prometheus::Labels& labels = {});
  prometheus::Histogram& Histogram(const std::string& name, const std::string& help,
                                   const std::vector<double>& bucket_bounds, const prometheus::Labels& labels = {});

  // Called before each Text(), one call at a time, to set gauges that nobody keeps up to date otherwise.
  void BeforeEachScrape(std::function<void()> refresh);

  // All of it in Prometheus' text format.
  std::string Text() const;

 private:
  prometheus::Registry registry_;
  std::vector<std::shared_ptr<prometheus::Collectable>> process_;
  mutable Mutex scraping_;
  std::vector<std::function<void()>> refreshes_ ABSL_GUARDED_BY(scraping_);
};

// 1, 2, 5, 10, 20, 50 ... from `first` to `last`, which are such numbers themselves: for seconds and bytes alike.
std::vector<double> BucketBounds(double first, double last);

// Calls that take time and may fail: how long they took, by operation, and how many failed, by operation and code.
class CallMetrics {
 public:
  // Makes PREFIX_seconds{operation} and PREFIX_errors_total{operation, code}. `metrics` outlives it.
  CallMetrics(Metrics& metrics, std::string prefix, std::string what);

  void Record(const std::string& operation, absl::Duration took, const absl::Status& status);

 private:
  Metrics& metrics_;
  const std::string prefix_;
  const std::string what_;
  const std::vector<double> bounds_;
};

}  // namespace meshwright
