// SPDX-License-Identifier: Apache-2.0
#include "coordinator/store/postgres_news.h"

#include <utility>
#include <vector>

#include <absl/strings/str_cat.h>
#include <absl/time/time.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/base/clock.h"
#include "common/base/mutex.h"
#include "coordinator/store/postgres_testing.h"

namespace meshwright {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;
using About = StoreNews::About;

// What a channel has heard.
class Ear {
 public:
  explicit Ear(StoreNewsChannel& channel) : channel_(channel) {
    channel_.SetListener([this](const StoreNews& news) {
      const MutexLock lock(mutex_);
      heard_.push_back(news);
      came_.NotifyAll();
    });
  }
  ~Ear() { channel_.SetListener(nullptr); }
  Ear(const Ear&) = delete;
  Ear& operator=(const Ear&) = delete;

  // The next `count`, or fewer after some seconds.
  std::vector<StoreNews> Take(size_t count, absl::Duration patience = absl::Seconds(10)) {
    const Stopwatch waited;
    MutexLock lock(mutex_);
    while (heard_.size() < count && waited.Elapsed() < patience) {
      came_.WaitFor(lock, absl::ToChronoNanoseconds(absl::Milliseconds(20)));
    }
    return std::exchange(heard_, {});
  }

 private:
  StoreNewsChannel& channel_;
  Mutex mutex_;
  ConditionVariable came_;
  std::vector<StoreNews> heard_ ABSL_GUARDED_BY(mutex_);
};

class PostgresNewsTest : public testing::Test {
 protected:
  void SetUp() override {
    const auto server = SharedTestPostgres();
    if (!server.ok()) GTEST_SKIP() << server.status();
    url_ = *server;
  }
  std::string url_;
};

TEST_F(PostgresNewsTest, OthersHearWhatOneTellsAndItselfDoesNot) {
  const auto north = OpenPostgresNews(url_);
  const auto south = OpenPostgresNews(url_);
  Ear at_north(*north);
  Ear at_south(*south);
  // Both listen now: what was before may have been missed.
  ASSERT_THAT(at_north.Take(1), ElementsAre(StoreNews{About::kAll, ""}));
  ASSERT_THAT(at_south.Take(1), ElementsAre(StoreNews{About::kAll, ""}));
  for (const StoreNews& news : {StoreNews{About::kJobs, ""}, {About::kResults, "castle 7"}, {About::kStates, ""}}) {
    north->Tell(news);
    EXPECT_THAT(at_south.Take(1), ElementsAre(news));
  }
  EXPECT_THAT(at_north.Take(1, absl::Milliseconds(100)), IsEmpty());
}

TEST_F(PostgresNewsTest, WhatIsToldOftenIsHeardAndNotOftener) {
  const auto north = OpenPostgresNews(url_);
  const auto south = OpenPostgresNews(url_);
  Ear at_south(*south);
  ASSERT_EQ(at_south.Take(1).size(), 1);
  for (int i = 0; i < 1000; ++i) north->Tell({About::kResults, "castle"});
  const std::vector<StoreNews> heard = at_south.Take(1000, absl::Milliseconds(500));
  EXPECT_THAT(heard, testing::Each(StoreNews{About::kResults, "castle"}));
  EXPECT_GE(heard.size(), 1);
  EXPECT_LT(heard.size(), 20);
}

TEST_F(PostgresNewsTest, ABrokenConnectionIsMadeAnewAndSaysSo) {
  const auto north = OpenPostgresNews(url_);
  const auto south = OpenPostgresNews(url_);
  Ear at_south(*south);
  ASSERT_EQ(at_south.Take(1).size(), 1);
  RunSql(url_,
         "SELECT count(pg_terminate_backend(pid)) FROM pg_stat_activity WHERE application_name = 'meshwright news'");
  EXPECT_THAT(at_south.Take(1), ElementsAre(StoreNews{About::kAll, ""}));
  north->Tell({About::kJobs, ""});
  EXPECT_THAT(at_south.Take(1), ElementsAre(StoreNews{About::kJobs, ""}));
}

TEST_F(PostgresNewsTest, AServerThatIsNotThereHoldsNobodyUp) {
  const auto news = OpenPostgresNews("postgresql://me@127.0.0.1:1/jobs");
  for (int i = 0; i < 1000; ++i) news->Tell({About::kResults, absl::StrCat("castle ", i)});
}

}  // namespace
}  // namespace meshwright
