// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <deque>
#include <functional>
#include <map>
#include <string>
#include <thread>
#include <vector>

#include "common/base/mutex.h"

namespace meshwright {

// Threads for work that blocks. Callers take turns, and none has more than half of the threads, so that who asks for
// much does not keep the others waiting. Thread-safe.
class FairWorkerPool {
 public:
  // `threads` >= 2; `max_waiting`: tasks of all callers together.
  FairWorkerPool(int threads, size_t max_waiting);
  ~FairWorkerPool();
  FairWorkerPool(const FairWorkerPool&) = delete;
  FairWorkerPool& operator=(const FairWorkerPool&) = delete;

  // False when too many tasks wait, or after Shutdown(); the task is then dropped.
  bool Submit(const std::string& caller, std::function<void()> task);
  // Ends the threads after the tasks that run; those that wait are dropped.
  void Shutdown();

 private:
  struct Caller {
    std::deque<std::function<void()>> waiting;
    int running = 0;
    bool has_turn = false;  // is in turns_
  };
  void Run();
  void GiveTurn(const std::string& name, Caller& caller) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  const int max_running_;  // of one caller
  const size_t max_waiting_;
  Mutex mutex_;
  ConditionVariable wake_;
  std::map<std::string, Caller> callers_ ABSL_GUARDED_BY(mutex_);
  // Callers that have a task and may run one more.
  std::deque<std::string> turns_ ABSL_GUARDED_BY(mutex_);
  size_t waiting_ ABSL_GUARDED_BY(mutex_) = 0;
  bool stopping_ ABSL_GUARDED_BY(mutex_) = false;
  std::vector<std::thread> threads_;
};

}  // namespace meshwright
