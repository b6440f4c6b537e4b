#include "coordinator/api/lease_book.h"

#include <utility>

#include <absl/strings/str_cat.h>

namespace meshwright {
namespace {

// Workers are shown for a while after they were heard of last.
constexpr int kLeasesUntilForgotten = 10;

}  // namespace

absl::Status LeaseOptions::Validate() const {
  if (lease < absl::Milliseconds(100)) {
    return absl::InvalidArgumentError(absl::StrCat("lease is ", absl::FormatDuration(lease), ", expected >= 0.1 s"));
  }
  if (job_time_limit < lease) {
    return absl::InvalidArgumentError(absl::StrCat("job_time_limit is ", absl::FormatDuration(job_time_limit),
                                                   ", expected at least the lease, ", absl::FormatDuration(lease)));
  }
  return absl::OkStatus();
}

void LeaseBook::AddReconstruction(const std::string& id, double weight) { shares_[id].weight = weight; }

void LeaseBook::RemoveReconstruction(const std::string& id) {
  const JobKey first = {.reconstruction = id};
  for (auto it = leases_.lower_bound(first); it != leases_.end() && it->first.reconstruction == id;) {
    const JobKey key = (it++)->first;
    Drop(key);
  }
  shares_.erase(id);
}

void LeaseBook::Offer(const std::string& id, LeasableJob job, absl::Time not_before) {
  const auto share = shares_.find(id);
  if (share == shares_.end()) return;
  const SequenceNumber sequence = job.spec.sequence;
  share->second.waiting[sequence] = {.job = std::move(job), .not_before = not_before};
}

std::vector<LeaseBook::Lease> LeaseBook::Hear(const WorkerCapacity& capacity, absl::Time now) {
  Worker& worker = workers_[capacity.id];
  std::vector<Lease> lost;
  if (worker.capacity.instance != capacity.instance) {
    for (const JobKey& key : std::set<JobKey>(worker.leases)) {
      lost.push_back(leases_.at(key));
      Drop(key);
    }
  }
  worker.capacity = capacity;
  worker.last_seen = now;
  for (const JobKey& key : worker.leases) leases_.at(key).expires = now + options_.lease;
  return lost;
}

bool LeaseBook::End(const std::string& worker, const JobKey& key) {
  const auto found = leases_.find(key);
  if (found == leases_.end() || found->second.worker != worker) return false;
  Drop(key);
  return true;
}

void LeaseBook::Drop(const JobKey& key) {
  const auto found = leases_.find(key);
  Worker& worker = workers_.at(found->second.worker);
  worker.leases.erase(key);
  worker.leased_bytes -= found->second.job.memory_bytes;
  --shares_.at(key.reconstruction).leases;
  leases_.erase(found);
}

const LeaseBook::Waiting* LeaseBook::FirstFitting(const Share& share, int64_t free_bytes, absl::Time now) const {
  for (const auto& [sequence, waiting] : share.waiting) {
    if (waiting.not_before <= now && waiting.job.memory_bytes <= free_bytes) return &waiting;
  }
  return nullptr;
}

bool LeaseBook::Grant(const std::string& worker_id, absl::Time now) {
  Worker& worker = workers_.at(worker_id);
  bool granted = false;
  while (!worker.capacity.draining && static_cast<int>(worker.leases.size()) < worker.capacity.cores) {
    const int64_t free_bytes = worker.capacity.memory_bytes - worker.leased_bytes;
    std::pair<const std::string, Share>* best = nullptr;
    const Waiting* best_waiting = nullptr;
    for (auto& entry : shares_) {
      const Share& share = entry.second;
      if (best != nullptr && share.leases / share.weight >= best->second.leases / best->second.weight) continue;
      const Waiting* const waiting = FirstFitting(share, free_bytes, now);
      if (waiting == nullptr) continue;
      best = &entry;
      best_waiting = waiting;
    }
    if (best == nullptr) break;
    LeasableJob job = best_waiting->job;
    best->second.waiting.erase(job.spec.sequence);
    ++best->second.leases;
    const JobKey key = {best->first, job.spec.sequence, job.spec.epoch};
    worker.leases.insert(key);
    worker.leased_bytes += job.memory_bytes;
    leases_[key] = {
        .key = key, .job = std::move(job), .worker = worker_id, .expires = now + options_.lease, .begun = now};
    granted = true;
  }
  return granted;
}

std::vector<LeaseBook::Expired> LeaseBook::Expire(absl::Time now) {
  std::vector<Expired> expired;
  for (const auto& [key, lease] : leases_) {
    const bool too_long = now - lease.begun > options_.job_time_limit;
    if (too_long || lease.expires < now) expired.push_back({.lease = lease, .too_long = too_long});
  }
  for (const Expired& over : expired) Drop(over.lease.key);
  for (auto it = workers_.begin(); it != workers_.end();) {
    const bool forget =
        it->second.leases.empty() && now - it->second.last_seen > kLeasesUntilForgotten * options_.lease;
    it = forget ? workers_.erase(it) : std::next(it);
  }
  return expired;
}

std::vector<const LeaseBook::Lease*> LeaseBook::LeasesOf(const std::string& worker) const {
  std::vector<const Lease*> leases;
  const auto found = workers_.find(worker);
  if (found == workers_.end()) return leases;
  for (const JobKey& key : found->second.leases) leases.push_back(&leases_.at(key));
  return leases;
}

int LeaseBook::LeasesIn(const std::string& reconstruction) const {
  const auto found = shares_.find(reconstruction);
  return found == shares_.end() ? 0 : found->second.leases;
}

}  // namespace meshwright
