// SPDX-License-Identifier: Apache-2.0
#include "common/http_server/fair_worker_pool.h"

#include <utility>

#include "common/base/check.h"

namespace meshwright {

FairWorkerPool::FairWorkerPool(int threads, size_t max_waiting) : max_running_(threads / 2), max_waiting_(max_waiting) {
  MW_CHECK(threads >= 2);
  for (int i = 0; i < threads; ++i) threads_.emplace_back([this] { Run(); });
}

FairWorkerPool::~FairWorkerPool() { Shutdown(); }

void FairWorkerPool::GiveTurn(const std::string& name, Caller& caller) {
  if (caller.has_turn || caller.waiting.empty() || caller.running >= max_running_) return;
  caller.has_turn = true;
  turns_.push_back(name);
  wake_.NotifyOne();
}

bool FairWorkerPool::Submit(const std::string& caller, std::function<void()> task) {
  const MutexLock lock(mutex_);
  if (stopping_ || waiting_ >= max_waiting_) return false;
  ++waiting_;
  Caller& found = callers_[caller];
  found.waiting.push_back(std::move(task));
  GiveTurn(caller, found);
  return true;
}

void FairWorkerPool::Run() {
  MutexLock lock(mutex_);
  while (true) {
    while (!stopping_ && turns_.empty()) wake_.Wait(lock);
    if (stopping_) return;
    const std::string name = std::move(turns_.front());
    turns_.pop_front();
    Caller& caller = callers_[name];  // stays where it is: it has something running
    std::function<void()> task = std::move(caller.waiting.front());
    caller.waiting.pop_front();
    --waiting_;
    caller.has_turn = false;
    ++caller.running;
    GiveTurn(name, caller);
    lock.Unlock();
    task();
    task = nullptr;  // what it holds may be long to destroy
    lock.Lock();
    --caller.running;
    GiveTurn(name, caller);
    if (caller.running == 0 && caller.waiting.empty()) callers_.erase(name);
  }
}

void FairWorkerPool::Shutdown() {
  std::map<std::string, Caller> dropped;
  {
    const MutexLock lock(mutex_);
    stopping_ = true;
  }
  wake_.NotifyAll();
  for (std::thread& thread : threads_) {
    if (thread.joinable()) thread.join();
  }
  const MutexLock lock(mutex_);
  dropped.swap(callers_);
  turns_.clear();
}

}  // namespace meshwright
