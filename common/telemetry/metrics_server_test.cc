// SPDX-License-Identifier: Apache-2.0
#include "common/telemetry/metrics_server.h"

#include <string>
#include <thread>
#include <vector>

#include <absl/strings/str_cat.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <httplib.h>

namespace meshwright {
namespace {

using testing::HasSubstr;

TEST(MetricsServerTest, ServesMetricsAndHealth) {
  Metrics metrics("worker");
  auto& counter = metrics.Counter("meshwright_things_total", "Things.");
  absl::Status ready = absl::UnavailableError("no coordinator yet");
  const auto server = MetricsServer::Start("127.0.0.1:0", metrics, [&] { return ready; });
  ASSERT_TRUE(server.ok()) << server.status();
  httplib::Client client("127.0.0.1", (*server)->port());

  counter.Increment(3);
  const auto scraped = client.Get("/metrics");
  ASSERT_TRUE(scraped);
  EXPECT_EQ(scraped->status, 200);
  EXPECT_THAT(scraped->get_header_value("Content-Type"), HasSubstr("version=0.0.4"));
  EXPECT_THAT(scraped->body, HasSubstr("meshwright_things_total 3\n"));
  EXPECT_EQ(client.Get("/healthz")->status, 200);
  EXPECT_EQ(client.Get("/readyz")->status, 503);
  EXPECT_EQ(client.Get("/readyz")->body, "no coordinator yet\n");
  ready = absl::OkStatus();
  EXPECT_EQ(client.Get("/readyz")->status, 200);
  EXPECT_EQ(client.Get("/")->status, 404);
  EXPECT_EQ(client.Post("/metrics", "x", "text/plain")->status, 404);
}

TEST(MetricsServerTest, BadAddressesAreToldAtOnce) {
  const Metrics metrics("worker");
  for (const char* const address : {"", "9464", ":9464", "127.0.0.1:", "127.0.0.1:http", "127.0.0.1:65536"}) {
    EXPECT_TRUE(absl::IsInvalidArgument(MetricsServer::Start(address, metrics, absl::OkStatus).status())) << address;
  }
}

TEST(MetricsServerTest, APortIsNotShared) {
  const Metrics metrics("worker");
  const auto ready = [] { return absl::OkStatus(); };
  const auto first = MetricsServer::Start("127.0.0.1:0", metrics, ready);
  ASSERT_TRUE(first.ok());
  const auto second = MetricsServer::Start(absl::StrCat("127.0.0.1:", (*first)->port()), metrics, ready);
  EXPECT_TRUE(absl::IsUnavailable(second.status()));
}

TEST(MetricsServerTest, ManyScrapersAreAnswered) {
  const Metrics metrics("worker");
  const auto server = MetricsServer::Start("127.0.0.1:0", metrics, [] { return absl::OkStatus(); });
  ASSERT_TRUE(server.ok());
  std::vector<std::thread> scrapers;
  std::atomic<int> answered = 0;
  for (int i = 0; i < 8; ++i) {
    scrapers.emplace_back([&] {
      for (int j = 0; j < 10; ++j) {
        const auto response = httplib::Client("127.0.0.1", (*server)->port()).Get("/metrics");
        if (response && response->status == 200) ++answered;
      }
    });
  }
  for (std::thread& scraper : scrapers) scraper.join();
  EXPECT_EQ(answered, 80);
}

}  // namespace
}  // namespace meshwright
