// SPDX-License-Identifier: Apache-2.0
#include "coordinator/rest/event_feeds.h"

#include <algorithm>
#include <set>
#include <utility>

#include <absl/strings/str_cat.h>

#include "common/base/status_macros.h"
#include "coordinator/rest/json.h"

namespace meshwright {
namespace {

// So many events are handed to a client at a time, at most: what it does not read takes no more memory than that.
constexpr size_t kEventsAtATime = 64;
constexpr absl::Duration kLookAgainPerStream = absl::Microseconds(500);
constexpr char kRetry[] = "retry: 2000\n\n";

std::string Event(int64_t id, const char* name, const std::string& data) {
  return absl::StrCat("id: ", id, "\nevent: ", name, "\ndata: ", data, "\n\n");
}

}  // namespace

// One watched reconstruction. Needs the lock.
struct EventFeeds::Feed {
  struct PartEvent {
    SequenceNumber sequence = 0;
    std::string text;  // as it is sent, to whomever
  };
  void Wake() const {
    for (const Stream* stream : streams) {
      if (stream->wake_) stream->wake_();
    }
  }
  std::set<const Stream*> streams;
  bool looked = false;
  int64_t version = 0;  // of `reconstruction`; 0: there is none yet
  std::string reconstruction;
  int64_t committed = -1;  // as of which the parts were listed
  std::vector<PartEvent> parts;
  bool over = false;  // nothing will change any more
  bool gone = false;  // deleted
};

EventFeeds::EventFeeds(const ReconstructionService& service, const EventFeedOptions& options)
    : service_(service), options_(options), thread_([this] { Run(); }) {}

EventFeeds::~EventFeeds() {
  Shutdown();
  thread_.join();
}

void EventFeeds::Shutdown() {
  {
    const MutexLock lock(mutex_);
    stopping_ = true;
    for (const auto& [id, feed] : feeds_) feed->Wake();
  }
  wake_.NotifyAll();
}

int EventFeeds::streams() const {
  const MutexLock lock(mutex_);
  return streams_;
}

absl::StatusOr<std::unique_ptr<EventFeeds::Stream>> EventFeeds::Open(const std::string& id, const std::string& caller,
                                                                     int64_t after_part) {
  MW_RETURN_IF_ERROR(service_.Get(id).status());
  std::unique_ptr<Stream> stream;
  {
    const MutexLock lock(mutex_);
    if (stopping_) return absl::UnavailableError("the coordinator is going down");
    if (streams_ >= options_.max_streams) {
      return absl::UnavailableError(absl::StrCat("there are ", streams_, " event streams, expected fewer than ",
                                                 options_.max_streams, "; try again later"));
    }
    int& has = streams_of_[caller];
    if (has >= options_.max_streams_per_caller) {
      return absl::ResourceExhaustedError(absl::StrCat("you have ", has, " event streams, expected fewer than ",
                                                       options_.max_streams_per_caller, "; try again later"));
    }
    ++has;
    ++streams_;
    std::shared_ptr<Feed>& feed = feeds_[id];
    if (feed == nullptr) feed = std::make_shared<Feed>();
    stream = std::unique_ptr<Stream>(new Stream(*this, id, caller, feed, after_part));
    feed->streams.insert(stream.get());
  }
  wake_.NotifyAll();
  return stream;
}

void EventFeeds::Run() {
  MutexLock lock(mutex_);
  while (!stopping_) {
    const std::map<std::string, std::shared_ptr<Feed>> watched = feeds_;
    lock.Unlock();
    bool changing = false;
    for (const auto& [id, feed] : watched) changing = Look(id, *feed) || changing;
    lock.Lock();
    if (stopping_ || HasNewFeed()) continue;
    if (changing) {
      wake_.WaitFor(lock, absl::ToChronoNanoseconds(LookAgain()));
    } else {
      wake_.Wait(lock);
    }
  }
}

bool EventFeeds::HasNewFeed() const {
  return std::any_of(feeds_.begin(), feeds_.end(), [](const auto& entry) { return !entry.second->looked; });
}

// Each change is written to each stream: the more there are, the rarer, so that writing takes a bounded share of a
// core.
absl::Duration EventFeeds::LookAgain() const { return std::max(options_.look_again, streams_ * kLookAgainPerStream); }

bool EventFeeds::Look(const std::string& id, Feed& feed) {
  int64_t committed = 0;
  SequenceNumber known = 0;
  {
    const MutexLock lock(mutex_);
    if (feed.over || feed.gone) return false;
    feed.looked = true;
    committed = feed.committed;
    if (!feed.parts.empty()) known = feed.parts.back().sequence;
  }
  // Parts after the reconstruction: when that is over there are no more than these.
  const absl::StatusOr<v1::Reconstruction> now = service_.Get(id);
  absl::Status status = now.status();
  const bool over = now.ok() && IsOver(now->state());
  std::vector<Feed::PartEvent> added;
  if (status.ok() && (over || now->progress().cameras_committed() != committed)) {
    const absl::StatusOr<v1::ListPartsResponse> parts = service_.ListParts(id, known);
    status = parts.status();
    for (int i = 0; parts.ok() && i < parts->parts_size(); ++i) {
      const v1::Part& part = parts->parts(i);
      added.push_back({part.sequence(), Event(part.sequence(), "part", ToJson(part))});
    }
  }
  // Whoever comes back hears why. A store that cannot be reached comes back itself.
  if (!status.ok() && !absl::IsNotFound(status)) return true;
  const std::string json = status.ok() ? ToJson(*now) : "";
  {
    const MutexLock lock(mutex_);
    if (!status.ok()) {
      feed.gone = true;
      const auto found = feeds_.find(id);
      if (found != feeds_.end() && found->second.get() == &feed) feeds_.erase(found);
    } else if (json != feed.reconstruction || !added.empty() || over) {
      if (json != feed.reconstruction) {
        feed.reconstruction = json;
        ++feed.version;
      }
      feed.committed = now->progress().cameras_committed();
      for (Feed::PartEvent& part : added) feed.parts.push_back(std::move(part));
      feed.over = over;
    } else {
      return true;
    }
    feed.Wake();
  }
  return !over;
}

EventFeeds::Stream::Stream(EventFeeds& feeds, std::string id, std::string caller, std::shared_ptr<Feed> feed,
                           int64_t after_part)
    : feeds_(feeds), id_(std::move(id)), caller_(std::move(caller)), feed_(std::move(feed)), last_part_(after_part) {}

EventFeeds::Stream::~Stream() {
  const MutexLock lock(feeds_.mutex_);
  --feeds_.streams_;
  if (--feeds_.streams_of_[caller_] == 0) feeds_.streams_of_.erase(caller_);
  feed_->streams.erase(this);
  if (!feed_->streams.empty()) return;
  const auto found = feeds_.feeds_.find(id_);
  if (found != feeds_.feeds_.end() && found->second == feed_) feeds_.feeds_.erase(found);
}

void EventFeeds::Stream::SetWake(std::function<void()> wake) {
  const MutexLock lock(feeds_.mutex_);
  wake_ = std::move(wake);
}

std::optional<std::string> EventFeeds::Stream::Next() {
  const MutexLock lock(feeds_.mutex_);
  if (ended_ || feeds_.stopping_ || feed_->gone) return std::nullopt;
  std::string text;
  if (feed_->version != told_version_) {
    if (told_version_ == 0) text = kRetry;
    told_version_ = feed_->version;
    absl::StrAppend(&text, Event(last_part_, "reconstruction", feed_->reconstruction));
  }
  for (size_t count = 0; count < kEventsAtATime && next_part_ < feed_->parts.size(); ++next_part_) {
    const Feed::PartEvent& part = feed_->parts[next_part_];
    if (part.sequence <= last_part_) continue;
    last_part_ = part.sequence;
    text += part.text;
    ++count;
  }
  if (feed_->over && next_part_ == feed_->parts.size()) {
    absl::StrAppend(&text, Event(last_part_, "end", "{}"));
    ended_ = true;
  }
  return text;
}

}  // namespace meshwright
