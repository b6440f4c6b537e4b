// SPDX-License-Identifier: Apache-2.0
#include "common/telemetry/log.h"

#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

namespace meshwright {
namespace {

using nlohmann::json;

class LogTest : public testing::Test {
 protected:
  Logger Make(Logger::Format format) {
    return {format, clock_, [this](const std::string& line) { lines_.push_back(line); }};
  }
  const ManualClock clock_;
  std::vector<std::string> lines_;
};

TEST_F(LogTest, JsonLinesHoldTimeLevelMessageAndFields) {
  Make(Logger::Format::kJson)
      .With({{"worker", "w1"}})
      .Warning("job failed", {{"camera", int64_t{3}}, {"seconds", 1.5}});
  ASSERT_EQ(lines_.size(), 1U);
  const json line = json::parse(lines_[0]);
  EXPECT_EQ(line, (json{{"time", "2001-09-09T01:46:40.000Z"},
                        {"level", "warning"},
                        {"message", "job failed"},
                        {"worker", "w1"},
                        {"camera", 3},
                        {"seconds", 1.5}}));
}

TEST_F(LogTest, AnyTextStaysOneReadableLine) {
  const std::string nasty = "two\nlines \"quoted\" and \xff no text";
  for (const auto format : {Logger::Format::kJson, Logger::Format::kText}) {
    Make(format).Error(nasty, {{"error", nasty}});
    EXPECT_THAT(lines_.back(), testing::Not(testing::HasSubstr("\n")));
  }
  const json line = json::parse(lines_[0], nullptr, false);
  ASSERT_FALSE(line.is_discarded());
  EXPECT_EQ(line["error"], "two\nlines \"quoted\" and \xEF\xBF\xBD no text");
}

TEST_F(LogTest, TextQuotesOnlyWhatNeedsIt) {
  Make(Logger::Format::kText).Info("hello", {{"a", "plain"}, {"b", "two words"}, {"c", ""}, {"d", int64_t{7}}});
  EXPECT_EQ(lines_[0], "2001-09-09T01:46:40.000Z info    hello  a=plain  b=\"two words\"  c=\"\"  d=7");
}

TEST_F(LogTest, FieldsOfACopyAreItsOwn) {
  const Logger logger = Make(Logger::Format::kText);
  logger.With({{"a", int64_t{1}}}).Info("one");
  logger.Info("two");
  EXPECT_THAT(lines_[0], testing::EndsWith("one  a=1"));
  EXPECT_THAT(lines_[1], testing::EndsWith("two"));
}

TEST_F(LogTest, ThreadsDoNotMixLines) {
  const Logger logger = Make(Logger::Format::kText);
  std::vector<std::thread> threads;
  for (int64_t t = 0; t < 4; ++t) {
    threads.emplace_back([&logger, t] {
      for (int i = 0; i < 100; ++i) logger.With({{"thread", t}}).Info("said");
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(lines_.size(), 400U);
}

}  // namespace
}  // namespace meshwright
