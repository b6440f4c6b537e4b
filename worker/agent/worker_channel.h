// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <absl/status/statusor.h>

#include "meshwright/v1/worker.pb.h"

namespace meshwright {

// The way to the coordinator: a network, or in tests the coordinator itself.
class WorkerChannel {
 public:
  virtual ~WorkerChannel() = default;
  virtual absl::StatusOr<v1::SynchronizeResponse> Synchronize(const v1::SynchronizeRequest& request) = 0;
  // From another thread: the call that waits now, or the next one, ends with Cancelled.
  virtual void Interrupt() = 0;
};

}  // namespace meshwright
