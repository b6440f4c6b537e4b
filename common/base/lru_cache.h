// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <list>
#include <memory>
#include <utility>

#include <absl/container/flat_hash_map.h>
#include <absl/status/statusor.h>

#include "common/base/mutex.h"
#include "common/base/status_macros.h"

namespace meshwright {

// Values that are needed again and again, loaded once and kept up to a budget of bytes(), the least recently used going
// first. Thread-safe; two threads that want the same one at the same time may both load it.
template <typename Key, typename Value>
class LruCache {
 public:
  using Loader = std::function<absl::StatusOr<Value>(const Key& key)>;

  LruCache(Loader loader, int64_t budget_bytes) : loader_(std::move(loader)), budget_bytes_(budget_bytes) {}

  // The loader's error when it fails; the next call tries again.
  absl::StatusOr<std::shared_ptr<const Value>> Get(const Key& key) {
    {
      const MutexLock lock(mutex_);
      if (const auto found = entry_of_key_.find(key); found != entry_of_key_.end()) {
        kept_.splice(kept_.begin(), kept_, found->second);
        return kept_.front().value;
      }
    }
    MW_ASSIGN_OR_RETURN(Value loaded, loader_(key));
    auto value = std::make_shared<const Value>(std::move(loaded));
    const MutexLock lock(mutex_);
    if (value->bytes() > budget_bytes_ || entry_of_key_.contains(key)) return value;
    kept_.push_front({key, value});
    entry_of_key_[key] = kept_.begin();
    kept_bytes_ += value->bytes();
    while (kept_bytes_ > budget_bytes_) {
      kept_bytes_ -= kept_.back().value->bytes();
      entry_of_key_.erase(kept_.back().key);
      kept_.pop_back();
    }
    return value;
  }

 private:
  struct Entry {
    Key key;
    std::shared_ptr<const Value> value;
  };

  const Loader loader_;
  const int64_t budget_bytes_;
  Mutex mutex_;
  std::list<Entry> kept_ ABSL_GUARDED_BY(mutex_);  // last used first
  absl::flat_hash_map<Key, typename std::list<Entry>::iterator> entry_of_key_ ABSL_GUARDED_BY(mutex_);
  int64_t kept_bytes_ ABSL_GUARDED_BY(mutex_) = 0;
};

}  // namespace meshwright
