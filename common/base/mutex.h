// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <condition_variable>
#include <mutex>

#include <absl/base/thread_annotations.h>

namespace meshwright {

// The standard's mutex, lock and condition variable, named so that clang's thread-safety analysis (scripts/lint) can
// hold ABSL_GUARDED_BY: what a mutex guards is only touched under it. Not absl::Mutex: the thread sanitizer does not
// see what Debian's Abseil locks.
class ABSL_LOCKABLE Mutex {
 public:
  Mutex() = default;
  Mutex(const Mutex&) = delete;
  Mutex& operator=(const Mutex&) = delete;

 private:
  friend class MutexLock;
  std::mutex mutex_;
};

// Holds the mutex while it lives, but for the time between Unlock() and Lock().
class ABSL_SCOPED_LOCKABLE MutexLock {
 public:
  explicit MutexLock(Mutex& mutex) ABSL_EXCLUSIVE_LOCK_FUNCTION(mutex) : lock_(mutex.mutex_) {}
  ~MutexLock() ABSL_UNLOCK_FUNCTION() = default;
  MutexLock(const MutexLock&) = delete;
  MutexLock& operator=(const MutexLock&) = delete;

  void Lock() ABSL_EXCLUSIVE_LOCK_FUNCTION() { lock_.lock(); }
  void Unlock() ABSL_UNLOCK_FUNCTION() { lock_.unlock(); }

 private:
  friend class ConditionVariable;
  std::unique_lock<std::mutex> lock_;
};

// Waits in a loop over its condition, not with a predicate: the analysis does not look into one.
class ConditionVariable {
 public:
  // Releases the lock, waits for a notification (or for nothing: spurious wake-ups happen) and takes it again.
  void Wait(MutexLock& lock) { condition_.wait(lock.lock_); }
  // The same, for as long as `duration` at most.
  void WaitFor(MutexLock& lock, std::chrono::nanoseconds duration) { condition_.wait_for(lock.lock_, duration); }
  void NotifyOne() { condition_.notify_one(); }
  void NotifyAll() { condition_.notify_all(); }

 private:
  std::condition_variable condition_;
};

}  // namespace meshwright
