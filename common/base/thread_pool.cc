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
  std::mutex mutex;
  std::condition_variable all_done;
};

ThreadPool::ThreadPool(int threads) {
  MW_CHECK(threads >= 1);
  for (int i = 1; i < threads; ++i) helpers_.emplace_back([this] { HelperMain(); });
}

ThreadPool::~ThreadPool() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    stopping_ = true;
  }
  wake_.notify_all();
  for (std::thread& helper : helpers_) helper.join();
}

void ThreadPool::Work(Loop& loop) {
  while (true) {
    const int64_t piece = loop.next.fetch_add(1);
    if (piece >= loop.pieces) return;
    const int64_t begin = piece * loop.grain;
    (*loop.body)(begin, std::min(loop.count, begin + loop.grain));
    if (loop.finished.fetch_add(1) + 1 == loop.pieces) {
      const std::lock_guard<std::mutex> lock(loop.mutex);
      loop.all_done.notify_all();
    }
  }
}

void ThreadPool::HelperMain() {
  std::unique_lock<std::mutex> lock(mutex_);
  while (true) {
    wake_.wait(lock, [this] { return stopping_ || !loops_.empty(); });
    if (stopping_) return;
    const std::shared_ptr<Loop> loop = loops_.front();
    lock.unlock();
    Work(*loop);
    lock.lock();
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
      const std::lock_guard<std::mutex> lock(mutex_);
      loops_.push_back(loop);
    }
    wake_.notify_all();
  }
  Work(*loop);
  std::unique_lock<std::mutex> lock(loop->mutex);
  loop->all_done.wait(lock, [&] { return loop->finished.load() == loop->pieces; });
  lock.unlock();
  const std::lock_guard<std::mutex> pool_lock(mutex_);
  const auto it = std::find(loops_.begin(), loops_.end(), loop);
  if (it != loops_.end()) loops_.erase(it);
}

}  // namespace meshwright
// SPDX-License-Identifier: Apache-2.0
