#pragma once

#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <tuple>
#include <vector>

#include <absl/status/status.h>
#include <absl/time/time.h>

#include "common/job/camera_job_spec.h"

namespace meshwright {

struct LeaseOptions {
  absl::Duration lease = absl::Seconds(30);        // a worker that is silent longer has lost its jobs
  absl::Duration job_time_limit = absl::Hours(2);  // a job that takes longer has failed, however alive its worker is

  absl::Status Validate() const;
};

// Names one handing-out of one camera job.
struct JobKey {
  std::string reconstruction;
  SequenceNumber sequence = 0;
  int64_t epoch = 0;

  auto operator<=>(const JobKey&) const = default;
};

struct LeasableJob {
  CameraJobSpec spec;
  int64_t memory_bytes = 0;  // what it takes at most
};

struct WorkerCapacity {
  std::string id;
  std::string instance;  // drawn anew by each process of the worker
  std::string version;
  int cores = 0;  // jobs at the same time, at most
  int64_t memory_bytes = 0;
  bool draining = false;
};

// Who works on what. Pure bookkeeping: no threads, no clock, no store; not thread-safe. What it forgets when its
// process dies is found again in the JobStore, where epochs fence off whoever still works for the dead one.
class LeaseBook {
 public:
  struct Lease {
    JobKey key;
    LeasableJob job;
    std::string worker;
    absl::Time expires;
    absl::Time begun;
  };
  struct Worker {
    WorkerCapacity capacity;
    absl::Time last_seen;
    int64_t leased_bytes = 0;
    std::set<JobKey> leases;
  };

  explicit LeaseBook(const LeaseOptions& options) : options_(options) {}

  // `weight` > 0: share of the workers against other reconstructions.
  void AddReconstruction(const std::string& id, double weight);
  // With all its jobs and leases.
  void RemoveReconstruction(const std::string& id);
  // A job that may be leased from `not_before` on.
  void Offer(const std::string& id, LeasableJob job, absl::Time not_before);

  // Notes that the worker is there and prolongs its leases. Returns what an earlier process of it held and lost.
  std::vector<Lease> Hear(const WorkerCapacity& capacity, absl::Time now);
  // Ends a lease, for whatever reason. False when the worker has no such lease (any more).
  bool End(const std::string& worker, const JobKey& key);
  // Gives the worker what it can take: of the reconstruction with the fewest leases for its weight first, of one
  // reconstruction by sequence. Returns whether there was something.
  bool Grant(const std::string& worker, absl::Time now);

  struct Expired {
    Lease lease;
    bool too_long = false;  // job_time_limit, otherwise the worker is silent
  };
  // Ends leases that are over and forgets workers that have been silent for long.
  std::vector<Expired> Expire(absl::Time now);

  std::vector<const Lease*> LeasesOf(const std::string& worker) const;  // by key
  int LeasesIn(const std::string& reconstruction) const;
  const std::map<std::string, Worker>& workers() const { return workers_; }

 private:
  struct Waiting {
    LeasableJob job;
    absl::Time not_before;
  };
  struct Share {
    double weight = 1;
    int leases = 0;
    std::map<SequenceNumber, Waiting> waiting;
  };
  void Drop(const JobKey& key);
  const Waiting* FirstFitting(const Share& share, int64_t free_bytes, absl::Time now) const;

  const LeaseOptions options_;
  std::map<std::string, Share> shares_;
  std::map<JobKey, Lease> leases_;
  std::map<std::string, Worker> workers_;
};

}  // namespace meshwright
