// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include <absl/status/statusor.h>

#include "common/base/clock.h"
#include "common/telemetry/log.h"
#include "common/telemetry/metrics.h"
#include "coordinator/auth/gatekeeper.h"
#include "coordinator/main/coordinator_program.h"
#include "coordinator/store/job_store.h"

namespace meshwright {

// Who may what, as the settings say, with its audit log (lines "audit" of `log`) and meshwright_calls_refused_total.
// All of it outlives the gate. NotFound or InvalidArgument names the setting.
absl::StatusOr<std::unique_ptr<Gatekeeper>> OpenGate(const CoordinatorSettings& settings, JobStore& store,
                                                     const Clock& clock, const Logger& log, Metrics& metrics);

}  // namespace meshwright
