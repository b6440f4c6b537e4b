#pragma once

#include <condition_variable>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <absl/time/time.h>

#include "coordinator/api/reconstruction_service.h"

namespace meshwright {

struct EventFeedOptions {
  int max_streams = 200;  // clients at the same time
  absl::Duration look_again = absl::Milliseconds(250);
  absl::Duration heartbeat = absl::Seconds(15);
};

// What happens to reconstructions, as server-sent events (WHATWG HTML, section 9.2) for any number of clients. One
// thread looks at each watched reconstruction, however many watch it. Nothing is queued for a client: it has read up to
// some part of a list that all share, and states in between are left out. Thread-safe.
class EventFeeds {
 private:
  struct Feed;

 public:
  EventFeeds(const ReconstructionService& service, const EventFeedOptions& options);
  // Ends all streams.
  ~EventFeeds();

  // One client's stream. Destroying it makes room for another one.
  class Stream {
   public:
    ~Stream();
    Stream(const Stream&) = delete;
    Stream& operator=(const Stream&) = delete;

    // Waits for events and returns their text; a comment when there are none for some time. "" ends the stream.
    std::string Next();

   private:
    friend class EventFeeds;
    Stream(EventFeeds& feeds, std::string id, std::shared_ptr<Feed> feed, int64_t after_part);

    EventFeeds& feeds_;
    const std::string id_;
    const std::shared_ptr<Feed> feed_;
    int64_t last_part_;
    size_t next_part_ = 0;
    int64_t told_version_ = 0;
    bool ended_ = false;
  };

  // Parts up to the sequence number `after_part` are known. NotFound; Unavailable when there are too many streams.
  absl::StatusOr<std::unique_ptr<Stream>> Open(const std::string& id, int64_t after_part);
  // Ends all streams; none is opened any more.
  void Shutdown();
  int streams() const;

 private:
  void Run();
  // Whether there may be news later.
  bool Look(const std::string& id, Feed& feed);

  const ReconstructionService& service_;
  const EventFeedOptions options_;
  mutable std::mutex mutex_;
  std::condition_variable news_;  // for streams
  std::condition_variable wake_;  // for the thread
  std::map<std::string, std::shared_ptr<Feed>> feeds_;
  int streams_ = 0;
  bool stopping_ = false;
  std::thread thread_;
};

}  // namespace meshwright
