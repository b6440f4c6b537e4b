// SPDX-License-Identifier: Apache-2.0
#include "common/base/thread_pool.h"

#include <algorithm>
#include <atomic>

#include "common/base/check.h"

namespace meshwright {

struct ThreadPool::Loop {
  int64_t count = 0;
  int64_t grain = 1;
  int64_t pieces = 0;
  const std::function<void(int64_t, int64_t)>* body = nullptr;
  std::atomic<int64_t> next{0};
  std::atomic<int64_t> finished{0};
  Mutex mutex;
  ConditionVariable all_done;
};

ThreadPool::ThreadPool(int threads) {
  MW_CHECK(threads >= 1);
  for (int i = 1; i < threads; ++i) helpers_.emplace_back([this] { HelperMain(); });
}

ThreadPool::~ThreadPool() {
  {
    const MutexLock lock(mutex_);
    stopping_ = true;
  }
  wake_.NotifyAll();
  for (std::thread& helper : helpers_) helper.join();
}

void ThreadPool::Work(Loop& loop) {
  while (true) {
    const int64_t piece = loop.next.fetch_add(1);
    if (piece >= loop.pieces) return;
    const int64_t begin = piece * loop.grain;
    (*loop.body)(begin, std::min(loop.count, begin + loop.grain));
    if (loop.finished.fetch_add(1) + 1 == loop.pieces) {
      const MutexLock lock(loop.mutex);
      loop.all_done.NotifyAll();
    }
  }
}

void ThreadPool::HelperMain() {
  MutexLock lock(mutex_);
  while (true) {
    while (!stopping_ && loops_.empty()) wake_.Wait(lock);
    if (stopping_) return;
    const std::shared_ptr<Loop> loop = loops_.front();
    lock.Unlock();
    Work(*loop);
    lock.Lock();
    // All pieces of this loop are taken: nobody else needs to look at it.
    const auto it = std::find(loops_.begin(), loops_.end(), loop);
    if (it != loops_.end()) loops_.erase(it);
  }
}

void ThreadPool::ParallelFor(int64_t count, int64_t grain, const std::function<void(int64_t, int64_t)>& body) {
  MW_CHECK(grain >= 1);
  if (count <= 0) return;
  auto loop = std::make_shared<Loop>();
  loop->count = count;
  loop->grain = grain;
  loop->pieces = (count + grain - 1) / grain;
  loop->body = &body;
  if (loop->pieces > 1 && !helpers_.empty()) {
    {
      const MutexLock lock(mutex_);
      loops_.push_back(loop);
    }
    wake_.NotifyAll();
  }
  Work(*loop);
  MutexLock lock(loop->mutex);
  while (loop->finished.load() != loop->pieces) loop->all_done.Wait(lock);
  lock.Unlock();
  const MutexLock pool_lock(mutex_);
  const auto it = std::find(loops_.begin(), loops_.end(), loop);
  if (it != loops_.end()) loops_.erase(it);
}

}  // namespace meshwright
