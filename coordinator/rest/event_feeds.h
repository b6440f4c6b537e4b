// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <absl/time/time.h>

#include "common/base/mutex.h"
#include "common/http_server/http_message.h"
#include "coordinator/api/reconstruction_service.h"

namespace meshwright {

struct EventFeedOptions {
  int max_streams = 2500;            // clients at the same time
  int max_streams_per_caller = 250;  // so that one of them leaves places to the others
  absl::Duration look_again = absl::Milliseconds(250);
};

// What happens to reconstructions, as server-sent events (WHATWG HTML, section 9.2) for any number of clients. One
// thread looks at each watched reconstruction, however many watch it. Nothing is queued for a client: it has read up to
// some part of a list that all share, and states in between are left out. Thread-safe.
class EventFeeds {
 private:
  struct Feed;

 public:
  EventFeeds(const ReconstructionService& service, const EventFeedOptions& options);
  // Ends all streams; none is left then.
  ~EventFeeds();

  // One client's stream. Destroying it makes room for another one.
  class Stream final : public HttpEventSource {
   public:
    ~Stream() override;
    std::optional<std::string> Next() override;
    std::string Heartbeat() override { return ":\n\n"; }
    void SetWake(std::function<void()> wake) override;

   private:
    friend class EventFeeds;
    Stream(EventFeeds& feeds, std::string id, std::string caller, std::shared_ptr<Feed> feed, int64_t after_part);

    EventFeeds& feeds_;
    const std::string id_;
    const std::string caller_;
    const std::shared_ptr<Feed> feed_;
    std::function<void()> wake_;
    int64_t last_part_;
    size_t next_part_ = 0;
    int64_t told_version_ = 0;
    bool ended_ = false;
  };

  // Parts up to the sequence number `after_part` are known. NotFound; Unavailable when there are too many streams,
  // ResourceExhausted when `caller` has too many.
  absl::StatusOr<std::unique_ptr<Stream>> Open(const std::string& id, const std::string& caller, int64_t after_part);
  // Ends all streams; none is opened any more.
  void Shutdown();
  int streams() const;

 private:
  void Run();
  // Whether there may be news later.
  bool Look(const std::string& id, Feed& feed);
  bool HasNewFeed() const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  absl::Duration LookAgain() const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  const ReconstructionService& service_;
  const EventFeedOptions options_;
  mutable Mutex mutex_;
  ConditionVariable wake_;  // for the thread
  std::map<std::string, std::shared_ptr<Feed>> feeds_ ABSL_GUARDED_BY(mutex_);
  std::map<std::string, int> streams_of_ ABSL_GUARDED_BY(mutex_);  // by caller
  int streams_ ABSL_GUARDED_BY(mutex_) = 0;
  bool stopping_ ABSL_GUARDED_BY(mutex_) = false;
  std::thread thread_;
};

}  // namespace meshwright
