// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <string>

#include <absl/status/statusor.h>
#include <grpcpp/grpcpp.h>

#include "common/base/mutex.h"
#include "coordinator/auth/gatekeeper.h"

namespace meshwright {

grpc::Status ToGrpc(const absl::Status& status);

// Whose key the call carries; where it carries none, the worker whose certificate the connection was made with.
absl::StatusOr<Caller> Identify(Gatekeeper& gate, const grpc::ServerContextBase& context);

// Who makes this call, if it may be made.
absl::StatusOr<Caller> Enter(Gatekeeper& gate, const grpc::ServerContextBase& context, const Request& request);

// `call(caller)` if the call may be made.
template <typename Call>
grpc::Status Guarded(Gatekeeper& gate, const grpc::ServerContextBase& context, const Request& request,
                     const Call& call) {
  const absl::StatusOr<Caller> caller = Enter(gate, context, request);
  return caller.ok() ? call(*caller) : ToGrpc(caller.status());
}

// Calls that last as long as their caller likes each hold a thread; nobody gets all of them. Thread-safe.
class LongCalls {
 public:
  LongCalls(int most, int most_of_one) : most_(most), most_of_one_(most_of_one) {}

  // `call()` if there is room for it, else ResourceExhausted.
  template <typename Call>
  absl::Status Run(const std::string& caller, const Call& call) {
    if (!Begin(caller)) return absl::ResourceExhaustedError("too many of these calls at the same time");
    const absl::Status status = call();
    End(caller);
    return status;
  }

 private:
  bool Begin(const std::string& caller);
  void End(const std::string& caller);

  const int most_;
  const int most_of_one_;
  Mutex mutex_;
  int all_ ABSL_GUARDED_BY(mutex_) = 0;
  std::map<std::string, int> of_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace meshwright
