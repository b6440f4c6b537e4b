// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <memory>
#include <string>
#include <vector>

#include <absl/time/time.h>

#include "common/blob/blob_store.h"
#include "worker/agent/worker_channel.h"

namespace meshwright::scale {

struct FakeWorkerFigures {
  std::vector<double> answer_seconds;  // of calls that bring a result: none of them is meant to wait
  double busy_seconds = 0;             // in camera jobs
  double elapsed_seconds = 0;
  int64_t jobs = 0;
  int64_t failed_calls = 0;
};

// Speaks the worker protocol as a worker with one core does; its camera jobs sleep and find the wall.
class FakeWorker {
 public:
  FakeWorker(std::string id, WorkerChannel& channel, BlobStore& blobs, absl::Duration job)
      : id_(std::move(id)), channel_(channel), blobs_(blobs), job_(job) {}

  // Until Stop().
  FakeWorkerFigures Run();
  // From another thread.
  void Stop();

 private:
  std::string id_;
  WorkerChannel& channel_;
  BlobStore& blobs_;
  absl::Duration job_;
  std::atomic<bool> stopping_ = false;
};

}  // namespace meshwright::scale
