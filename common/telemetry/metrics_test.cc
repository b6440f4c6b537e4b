// SPDX-License-Identifier: Apache-2.0
#include "common/telemetry/metrics.h"

#include <cstdlib>
#include <string>
#include <vector>

#include <absl/strings/str_cat.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/base/version.h"

namespace meshwright {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

TEST(MetricsTest, SaysWhichProgramItIs) {
  const std::string text = Metrics("worker").Text();
  EXPECT_THAT(
      text, HasSubstr(absl::StrCat("meshwright_build_info{program=\"worker\",version=\"", kProgramVersion, "\"} 1\n")));
  for (const char* const name : {"process_cpu_seconds_total", "process_resident_memory_bytes", "process_open_fds",
                                 "process_max_fds", "process_threads", "process_start_time_seconds"}) {
    EXPECT_THAT(text, HasSubstr(std::string("\n") + name + " ")) << name;
  }
}

TEST(MetricsTest, TheSameNameIsTheSameMetric) {
  Metrics metrics("worker");
  metrics.Counter("meshwright_a_total", "help", {{"kind", "x"}}).Increment();
  metrics.Counter("meshwright_a_total", "help", {{"kind", "x"}}).Increment();
  metrics.Counter("meshwright_a_total", "help", {{"kind", "y"}}).Increment();
  EXPECT_THAT(metrics.Text(), HasSubstr("meshwright_a_total{kind=\"x\"} 2\n"));
  EXPECT_THAT(metrics.Text(), HasSubstr("meshwright_a_total{kind=\"y\"} 1\n"));
}

TEST(MetricsTest, RefreshesComeBeforeTheText) {
  Metrics metrics("worker");
  auto& gauge = metrics.Gauge("meshwright_g", "help");
  double value = 0;
  metrics.BeforeEachScrape([&] { gauge.Set(++value); });
  EXPECT_THAT(metrics.Text(), HasSubstr("meshwright_g 1\n"));
  EXPECT_THAT(metrics.Text(), HasSubstr("meshwright_g 2\n"));
}

TEST(MetricsTest, BucketBoundsReadAsPeopleWriteThem) {
  EXPECT_THAT(BucketBounds(0.001, 0.1), ElementsAre(0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1));
  EXPECT_THAT(BucketBounds(0.5, 20), ElementsAre(0.5, 1, 2, 5, 10, 20));
}

TEST(MetricsTest, CallsAreTimedAndOnlyFailuresCountAsErrors) {
  Metrics metrics("coordinator");
  CallMetrics calls(metrics, "meshwright_store", "Calls");
  calls.Record("get", absl::Milliseconds(30), absl::OkStatus());
  EXPECT_THAT(metrics.Text(), Not(HasSubstr("meshwright_store_errors_total")));
  calls.Record("get", absl::Milliseconds(300), absl::UnavailableError("down"));
  const std::string text = metrics.Text();
  EXPECT_THAT(text, HasSubstr("meshwright_store_seconds_bucket{operation=\"get\",le=\"0.05\"} 1\n"));
  EXPECT_THAT(text, HasSubstr("meshwright_store_seconds_bucket{operation=\"get\",le=\"0.5\"} 2\n"));
  EXPECT_THAT(text, HasSubstr("meshwright_store_seconds_count{operation=\"get\"} 2\n"));
  EXPECT_THAT(text, HasSubstr("meshwright_store_errors_total{code=\"unavailable\",operation=\"get\"} 1\n"));
}

}  // namespace
}  // namespace meshwright
