// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <thread>
#include <vector>

#include "common/base/mutex.h"

namespace meshwright {

// Threads that help whoever calls ParallelFor. Several threads may call at the same time; the caller always works too,
// so a pool of 0 helpers means "run in the calling thread".
class ThreadPool {
 public:
  // `threads`: cores to use in one ParallelFor, the caller included (>= 1).
  explicit ThreadPool(int threads);
  ~ThreadPool();
  ThreadPool(const ThreadPool&) = delete;
  ThreadPool& operator=(const ThreadPool&) = delete;

  int threads() const { return static_cast<int>(helpers_.size()) + 1; }

  // Calls body(begin, end) over pieces of [0, count) of at most `grain` items, in any order and on any thread; returns
  // when all are done. The pieces' bounds depend on count and grain only, never on the number of threads: a body that
  // writes only to what belongs to its piece gives the same result on any machine.
  void ParallelFor(int64_t count, int64_t grain, const std::function<void(int64_t begin, int64_t end)>& body);

 private:
  struct Loop;
  void HelperMain();
  static void Work(Loop& loop);

  Mutex mutex_;
  ConditionVariable wake_;
  std::deque<std::shared_ptr<Loop>> loops_ ABSL_GUARDED_BY(mutex_);
  bool stopping_ ABSL_GUARDED_BY(mutex_) = false;
  std::vector<std::thread> helpers_;
};

}  // namespace meshwright
