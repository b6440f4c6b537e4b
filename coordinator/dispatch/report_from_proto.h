// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "meshwright/v1/worker.pb.h"

#include "coordinator/scheduling/worker_report.h"

namespace meshwright {

JobKey FromProto(const v1::JobKey& key);

// What a worker says over the wire.
WorkerReport FromProto(const v1::SynchronizeRequest& request);

}  // namespace meshwright
