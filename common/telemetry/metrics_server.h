// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>
#include <string>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "common/telemetry/metrics.h"

namespace meshwright {

// A small HTTP port for Prometheus and for whoever watches over the process: GET /metrics, /healthz (200 as long as the
// process answers) and /readyz (200, or 503 with the reason in one line). Nothing else is served, nothing is accepted.
class MetricsServer {
 public:
  // `address`: "host:port"; port 0 takes a free one. `ready` is called from threads of the server; both it and
  // `metrics` outlive the server. InvalidArgument, or Unavailable when the port is taken.
  static absl::StatusOr<std::unique_ptr<MetricsServer>> Start(const std::string& address, const Metrics& metrics,
                                                              std::function<absl::Status()> ready);
  virtual ~MetricsServer() = default;
  virtual int port() const = 0;
};

}  // namespace meshwright
