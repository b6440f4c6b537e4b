// SPDX-License-Identifier: Apache-2.0
#include "coordinator/schedule/schedule.h"

#include <algorithm>
#include <map>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace meshwright {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

struct World {
  IncidenceMatrix matrix;
  OverlapGraph overlaps;
};

World RandomWorld(int cameras, double pair_share, double overlap_share, std::mt19937& generator) {
  std::uniform_real_distribution<double> uniform(0, 1);
  World world{IncidenceMatrix(cameras), OverlapGraph(cameras)};
  std::vector<std::vector<CameraIndex>> rows(static_cast<size_t>(cameras));
  for (CameraIndex i = 0; i < cameras; ++i) {
    for (CameraIndex j = i + 1; j < cameras; ++j) {
      const bool feasible = uniform(generator) < pair_share;
      if (feasible) world.matrix.Set(i, j);
      if (!feasible && uniform(generator) >= overlap_share) continue;
      rows[static_cast<size_t>(i)].push_back(j);
      rows[static_cast<size_t>(j)].push_back(i);
    }
  }
  for (auto& row : rows) std::sort(row.begin(), row.end());
  world.overlaps = OverlapGraph(rows);
  return world;
}

// What a camera's job would answer: a function of the assignment alone, as the real one is.
JobOutcome Answer(const Assignment& assignment, double prune_share) {
  std::mt19937 generator(static_cast<unsigned>(1000 * assignment.camera + assignment.snapshot));
  std::uniform_real_distribution<double> uniform(0, 1);
  JobOutcome commit{.sequence = assignment.sequence, .camera = assignment.camera};
  for (const CameraIndex target : assignment.neighbours) {
    if (uniform(generator) < prune_share) commit.weak_targets.push_back(target);
  }
  commit.skipped = uniform(generator) < 0.1;
  if (commit.skipped) commit.weak_targets.clear();
  return commit;
}

struct History {
  std::vector<Assignment> assignments;
  std::vector<JobOutcome> commits;
};

History RunInOrder(Schedule schedule, double prune_share) {
  History run;
  while (!schedule.finished()) {
    for (Assignment& assignment : schedule.TakeChoices()) run.assignments.push_back(std::move(assignment));
    run.commits.push_back(Answer(schedule.in_flight().front(), prune_share));
    EXPECT_TRUE(schedule.Commit(run.commits.back()).ok());
  }
  EXPECT_THAT(schedule.TakeChoices(), IsEmpty());
  return run;
}

// Jobs end in random order; who ends early waits for its turn, as in a conductor.
History RunWithRandomCompletion(Schedule schedule, double prune_share, std::mt19937& generator) {
  History run;
  std::vector<Assignment> running;
  std::map<SequenceNumber, JobOutcome> ended;
  while (!schedule.finished()) {
    for (Assignment& assignment : schedule.TakeChoices()) {
      running.push_back(assignment);
      run.assignments.push_back(std::move(assignment));
    }
    std::shuffle(running.begin(), running.end(), generator);
    ended[running.back().sequence] = Answer(running.back(), prune_share);
    running.pop_back();
    while (!ended.empty() && ended.begin()->first == schedule.commits() + 1) {
      run.commits.push_back(ended.begin()->second);
      EXPECT_TRUE(schedule.Commit(ended.begin()->second).ok());
      ended.erase(ended.begin());
    }
  }
  return run;
}

// The rule for W = 1 as a textbook would write it, over a dense matrix.
std::vector<CameraIndex> NaiveOrder(const IncidenceMatrix& matrix, double prune_share) {
  const int cameras = matrix.cameras();
  std::vector<std::vector<bool>> bits(static_cast<size_t>(cameras), std::vector<bool>(static_cast<size_t>(cameras)));
  for (int i = 0; i < cameras; ++i) {
    for (int j = 0; j < cameras; ++j) bits[static_cast<size_t>(i)][static_cast<size_t>(j)] = matrix.Get(i, j);
  }
  std::vector<CameraIndex> order;
  for (SequenceNumber sequence = 1;; ++sequence) {
    int best = -1;
    auto best_sum = std::ptrdiff_t{0};
    for (int i = 0; i < cameras; ++i) {
      const auto& row = bits[static_cast<size_t>(i)];
      const auto sum = std::count(row.begin(), row.end(), true);
      if (sum > best_sum) {
        best = i;
        best_sum = sum;
      }
    }
    if (best < 0) return order;
    Assignment assignment{.sequence = sequence, .camera = best, .snapshot = sequence - 1};
    for (int j = 0; j < cameras; ++j) {
      if (bits[static_cast<size_t>(best)][static_cast<size_t>(j)]) assignment.neighbours.push_back(j);
    }
    order.push_back(best);
    bits[static_cast<size_t>(best)].assign(static_cast<size_t>(cameras), false);
    for (const CameraIndex weak : Answer(assignment, prune_share).weak_targets) {
      bits[static_cast<size_t>(weak)][static_cast<size_t>(best)] = false;
    }
  }
}

TEST(Schedule, WindowOfOneIsTheTextbook) {
  std::mt19937 generator(1);
  for (int trial = 0; trial < 50; ++trial) {
    const World world = RandomWorld(1 + trial, 0.2, 0.2, generator);
    const History run = RunInOrder(Schedule(world.matrix, world.overlaps, {.window = 1}), 0.1);
    std::vector<CameraIndex> order;
    for (const Assignment& assignment : run.assignments) {
      order.push_back(assignment.camera);
      EXPECT_EQ(assignment.snapshot, assignment.sequence - 1);
    }
    EXPECT_EQ(order, NaiveOrder(world.matrix, 0.1));
  }
}

TEST(Schedule, OrderOfCompletionDoesNotMatter) {
  std::mt19937 generator(2);
  for (int trial = 0; trial < 30; ++trial) {
    const World world = RandomWorld(40, 0.1, 0.1, generator);
    const ScheduleOptions options{.window = 1 + trial % 8, .max_overlap_in_flight = trial % 3};
    const History expected = RunInOrder(Schedule(world.matrix, world.overlaps, options), 0.2);
    for (int shuffle = 0; shuffle < 5; ++shuffle) {
      const History run = RunWithRandomCompletion(Schedule(world.matrix, world.overlaps, options), 0.2, generator);
      EXPECT_EQ(run.assignments, expected.assignments);
      EXPECT_EQ(run.commits, expected.commits);
    }
  }
}

TEST(Schedule, ReplayOfAnyPrefixGoesOnAlike) {
  std::mt19937 generator(3);
  const World world = RandomWorld(40, 0.15, 0.1, generator);
  const ScheduleOptions options{.window = 4, .max_overlap_in_flight = 1};
  const History expected = RunInOrder(Schedule(world.matrix, world.overlaps, options), 0.2);
  for (size_t prefix = 0; prefix <= expected.commits.size(); ++prefix) {
    const std::vector<JobOutcome> known(expected.commits.begin(),
                                        expected.commits.begin() + static_cast<std::ptrdiff_t>(prefix));
    absl::StatusOr<Schedule> replayed = Schedule::Replay(world.matrix, world.overlaps, options, known);
    ASSERT_TRUE(replayed.ok()) << replayed.status();
    const History rest = RunInOrder(*replayed, 0.2);
    // The replayed schedule gives out what is in flight at that point and everything after it.
    ASSERT_LE(prefix, expected.assignments.size());
    const std::vector<Assignment> tail(expected.assignments.begin() + static_cast<std::ptrdiff_t>(prefix),
                                       expected.assignments.end());
    EXPECT_EQ(rest.assignments, tail);
  }
}

TEST(Schedule, HoldsItsLimitsAndIsGreedy) {
  std::mt19937 generator(4);
  for (int trial = 0; trial < 30; ++trial) {
    const World world = RandomWorld(50, 0.1, 0.15, generator);
    const ScheduleOptions options{.window = 1 + trial % 6, .max_overlap_in_flight = trial % 3};
    Schedule schedule(world.matrix, world.overlaps, options);
    std::vector<bool> was_chosen(50, false);
    while (!schedule.finished()) {
      ASSERT_LE(static_cast<int>(schedule.in_flight().size()), options.window);
      std::vector<bool> in_flight(50, false);
      const auto overlaps_in_flight = [&](CameraIndex camera) {
        const auto& others = world.overlaps.Of(camera);
        return std::count_if(others.begin(), others.end(), [&](int o) { return in_flight[static_cast<size_t>(o)]; });
      };
      for (const Assignment& assignment : schedule.in_flight()) {
        EXPECT_LE(overlaps_in_flight(assignment.camera), options.max_overlap_in_flight);
        in_flight[static_cast<size_t>(assignment.camera)] = true;
      }
      for (const Assignment& assignment : schedule.TakeChoices()) {
        EXPECT_FALSE(was_chosen[static_cast<size_t>(assignment.camera)]);
        was_chosen[static_cast<size_t>(assignment.camera)] = true;
        EXPECT_EQ(assignment.snapshot, schedule.commits());
        EXPECT_EQ(assignment.neighbours, schedule.matrix().Neighbours(assignment.camera));
      }
      if (static_cast<int>(schedule.in_flight().size()) < options.window) {
        for (CameraIndex camera = 0; camera < 50; ++camera) {
          if (was_chosen[static_cast<size_t>(camera)] || schedule.matrix().RowSum(camera) == 0) continue;
          EXPECT_GT(overlaps_in_flight(camera), options.max_overlap_in_flight) << "room, and a camera that qualifies";
        }
      }
      ASSERT_TRUE(schedule.Commit(Answer(schedule.in_flight().front(), 0.3)).ok());
    }
    for (CameraIndex camera = 0; camera < 50; ++camera) EXPECT_EQ(schedule.matrix().RowSum(camera), 0);
  }
}

TEST(Schedule, EveryCameraWithAPairIsProcessedOnce) {
  std::mt19937 generator(5);
  for (int trial = 0; trial < 20; ++trial) {
    const World world = RandomWorld(40, 0.03, 0.1, generator);
    const History run = RunInOrder(Schedule(world.matrix, world.overlaps, {.window = 3}), 0);
    std::vector<CameraIndex> processed;
    for (const Assignment& assignment : run.assignments) processed.push_back(assignment.camera);
    std::sort(processed.begin(), processed.end());
    std::vector<CameraIndex> expected;
    for (CameraIndex camera = 0; camera < 40; ++camera) {
      if (world.matrix.RowSum(camera) > 0) expected.push_back(camera);
    }
    EXPECT_EQ(processed, expected);
  }
}

TEST(Schedule, TiesGoToTheLowestCamera) {
  IncidenceMatrix matrix(4);
  matrix.Set(0, 1);
  matrix.Set(2, 3);
  const History run = RunInOrder(Schedule(matrix, OverlapGraph(4), {.window = 1}), 0);
  std::vector<CameraIndex> order;
  for (const Assignment& assignment : run.assignments) order.push_back(assignment.camera);
  EXPECT_THAT(order, ElementsAre(0, 1, 2, 3));
}

TEST(Schedule, RefusesCommitsThatDoNotFitAndStaysAsItWas) {
  IncidenceMatrix matrix(3);
  matrix.Set(0, 1);
  matrix.Set(0, 2);
  Schedule schedule(matrix, OverlapGraph(3), {.window = 2});
  ASSERT_EQ(schedule.in_flight().size(), 2);
  EXPECT_FALSE(schedule.Commit({.sequence = 2, .camera = 1}).ok());
  EXPECT_FALSE(schedule.Commit({.sequence = 1, .camera = 1}).ok());
  EXPECT_FALSE(schedule.Commit({.sequence = 1, .camera = 0, .weak_targets = {3}}).ok());
  EXPECT_FALSE(schedule.Commit({.sequence = 1, .camera = 0, .weak_targets = {0}}).ok());
  EXPECT_EQ(schedule.matrix(), matrix);
  EXPECT_TRUE(schedule.Commit({.sequence = 1, .camera = 0, .weak_targets = {2}}).ok());
  EXPECT_EQ(schedule.waiting_cameras(), 0) << "camera 2 lost its only pair";
  EXPECT_TRUE(schedule.Commit({.sequence = 2, .camera = 1}).ok());
  EXPECT_TRUE(schedule.finished());
  EXPECT_FALSE(schedule.Commit({.sequence = 3, .camera = 2}).ok());
}

TEST(Schedule, TenThousandCamerasAreQuick) {
  constexpr int kCameras = 10000;
  constexpr int kReach = 50;
  IncidenceMatrix matrix(kCameras);
  std::vector<std::vector<CameraIndex>> rows(kCameras);
  for (CameraIndex i = 0; i < kCameras; ++i) {
    for (CameraIndex j = std::max(0, i - kReach); j <= std::min(kCameras - 1, i + kReach); ++j) {
      if (i == j) continue;
      rows[static_cast<size_t>(i)].push_back(j);
      if (j > i) matrix.Set(i, j);
    }
  }
  const History run = RunInOrder(Schedule(matrix, OverlapGraph(rows), {.window = 16}), 0.1);
  EXPECT_GT(run.commits.size(), 9000U);
}

}  // namespace
}  // namespace meshwright
