#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

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
  void GiveTurn(const std::string& name, Caller& caller);

  const int max_running_;  // of one caller
  const size_t max_waiting_;
  std::mutex mutex_;
  std::condition_variable wake_;
  std::map<std::string, Caller> callers_;
  std::deque<std::string> turns_;  // callers that have a task and may run one more
  size_t waiting_ = 0;
  bool stopping_ = false;
  std::vector<std::thread> threads_;
};

}  // namespace meshwright
