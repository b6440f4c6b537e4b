#include "coordinator/api/lease_book.h"

#include <map>

#include <absl/strings/str_cat.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace meshwright {
namespace {

using testing::ElementsAre;

const absl::Time kStart = absl::FromUnixSeconds(1'000'000);

WorkerCapacity Worker(const std::string& id, int cores = 1, int64_t memory_bytes = 1000) {
  return {.id = id, .instance = "1", .cores = cores, .memory_bytes = memory_bytes};
}

LeasableJob Job(SequenceNumber sequence, int64_t epoch = 1, int64_t memory_bytes = 10) {
  return {.spec = {.sequence = sequence, .epoch = epoch}, .memory_bytes = memory_bytes};
}

class LeaseBookTest : public testing::Test {
 protected:
  std::vector<std::string> HeldBy(const std::string& worker) const {
    std::vector<std::string> held;
    for (const LeaseBook::Lease* const lease : book_.LeasesOf(worker)) {
      held.push_back(absl::StrCat(lease->key.reconstruction, lease->key.sequence, ":", lease->key.epoch));
    }
    return held;
  }
  LeaseBook book_{{.lease = absl::Seconds(30), .job_time_limit = absl::Seconds(100)}};
};

TEST_F(LeaseBookTest, AWorkerGetsWhatFitsItsCoresAndMemory) {
  book_.AddReconstruction("a", 1);
  book_.Offer("a", Job(1, 1, 600), kStart);
  book_.Offer("a", Job(2, 1, 600), kStart);
  book_.Offer("a", Job(3, 1, 300), kStart);
  book_.Offer("a", Job(4, 1, 50), kStart);
  book_.Hear(Worker("w", 3), kStart);
  EXPECT_TRUE(book_.Grant("w", kStart));
  EXPECT_THAT(HeldBy("w"), ElementsAre("a1:1", "a3:1", "a4:1"));
  EXPECT_FALSE(book_.Grant("w", kStart));
  EXPECT_TRUE(book_.End("w", {"a", 1, 1}));
  EXPECT_TRUE(book_.Grant("w", kStart));
  EXPECT_THAT(HeldBy("w"), ElementsAre("a2:1", "a3:1", "a4:1"));
}

TEST_F(LeaseBookTest, ADrainingWorkerGetsNothing) {
  book_.AddReconstruction("a", 1);
  book_.Offer("a", Job(1), kStart);
  WorkerCapacity worker = Worker("w");
  worker.draining = true;
  book_.Hear(worker, kStart);
  EXPECT_FALSE(book_.Grant("w", kStart));
}

TEST_F(LeaseBookTest, ReconstructionsShareByWeight) {
  book_.AddReconstruction("a", 1);
  book_.AddReconstruction("b", 1);
  book_.AddReconstruction("c", 2);
  for (SequenceNumber sequence = 1; sequence <= 100; ++sequence) {
    for (const char* id : {"a", "b", "c"}) book_.Offer(id, Job(sequence), kStart);
  }
  book_.Hear(Worker("w", 40, 1'000'000), kStart);
  book_.Grant("w", kStart);
  EXPECT_EQ(book_.LeasesIn("a"), 10);
  EXPECT_EQ(book_.LeasesIn("b"), 10);
  EXPECT_EQ(book_.LeasesIn("c"), 20);
}

TEST_F(LeaseBookTest, ASilentWorkerLosesItsLeasesAndTheirEpochsAreOver) {
  book_.AddReconstruction("a", 1);
  book_.Offer("a", Job(1), kStart);
  book_.Hear(Worker("w"), kStart);
  book_.Grant("w", kStart);
  EXPECT_TRUE(book_.Expire(kStart + absl::Seconds(29)).empty());
  book_.Hear(Worker("w"), kStart + absl::Seconds(29));
  EXPECT_TRUE(book_.Expire(kStart + absl::Seconds(58)).empty());
  const auto expired = book_.Expire(kStart + absl::Seconds(60));
  ASSERT_EQ(expired.size(), 1);
  EXPECT_FALSE(expired[0].too_long);
  EXPECT_FALSE(book_.End("w", {"a", 1, 1}));
  book_.Offer("a", Job(1, 2), kStart);
  book_.Hear(Worker("other"), kStart + absl::Seconds(61));
  book_.Grant("other", kStart + absl::Seconds(61));
  EXPECT_FALSE(book_.End("other", {"a", 1, 1}));
  EXPECT_FALSE(book_.End("w", {"a", 1, 2}));
  EXPECT_TRUE(book_.End("other", {"a", 1, 2}));
}

TEST_F(LeaseBookTest, AWorkerThatHangsAndIsAliveLosesTheJobToo) {
  book_.AddReconstruction("a", 1);
  book_.Offer("a", Job(1), kStart);
  for (int second = 0; second <= 100; second += 10) {
    book_.Hear(Worker("w"), kStart + absl::Seconds(second));
    book_.Grant("w", kStart + absl::Seconds(second));
    EXPECT_TRUE(book_.Expire(kStart + absl::Seconds(second)).empty());
  }
  const auto expired = book_.Expire(kStart + absl::Seconds(101));
  ASSERT_EQ(expired.size(), 1);
  EXPECT_TRUE(expired[0].too_long);
}

TEST_F(LeaseBookTest, ANewProcessOfAWorkerHasLostWhatTheOldOneHeld) {
  book_.AddReconstruction("a", 1);
  book_.Offer("a", Job(1), kStart);
  book_.Hear(Worker("w"), kStart);
  book_.Grant("w", kStart);
  WorkerCapacity again = Worker("w");
  again.instance = "2";
  const auto lost = book_.Hear(again, kStart);
  ASSERT_EQ(lost.size(), 1);
  EXPECT_EQ(lost[0].key.sequence, 1);
  EXPECT_THAT(HeldBy("w"), ElementsAre());
}

TEST_F(LeaseBookTest, BackoffIsWaitedFor) {
  book_.AddReconstruction("a", 1);
  book_.Offer("a", Job(1), kStart + absl::Seconds(5));
  book_.Hear(Worker("w"), kStart);
  EXPECT_FALSE(book_.Grant("w", kStart + absl::Seconds(4)));
  EXPECT_TRUE(book_.Grant("w", kStart + absl::Seconds(5)));
}

TEST_F(LeaseBookTest, ARemovedReconstructionLeavesNothing) {
  book_.AddReconstruction("a", 1);
  book_.AddReconstruction("ab", 1);
  book_.Offer("a", Job(1), kStart);
  book_.Offer("a", Job(2), kStart);
  book_.Offer("ab", Job(1), kStart);
  book_.Hear(Worker("w", 2), kStart);
  book_.Grant("w", kStart);
  book_.RemoveReconstruction("a");
  EXPECT_THAT(HeldBy("w"), ElementsAre("ab1:1"));
  book_.Offer("a", Job(3), kStart);
  EXPECT_FALSE(book_.Grant("w", kStart));
}

}  // namespace
}  // namespace meshwright
