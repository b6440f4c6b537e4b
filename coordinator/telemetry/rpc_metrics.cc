// SPDX-License-Identifier: Apache-2.0
#include "coordinator/telemetry/rpc_metrics.h"

#include <string>

#include <absl/status/status.h>

#include "common/base/clock.h"

namespace meshwright {
namespace {

using grpc::experimental::InterceptionHookPoints;

// "/meshwright.v1.WorkerService/Synchronize" -> "Synchronize"
std::string NameOfMethod(const std::string& path) { return path.substr(path.rfind('/') + 1); }

class RpcInterceptor final : public grpc::experimental::Interceptor {
 public:
  RpcInterceptor(std::string operation, CallMetrics& calls) : operation_(std::move(operation)), calls_(calls) {}

  void Intercept(grpc::experimental::InterceptorBatchMethods* methods) override {
    if (methods->QueryInterceptionHookPoint(InterceptionHookPoints::PRE_SEND_STATUS)) {
      const auto code = static_cast<absl::StatusCode>(methods->GetSendStatus().error_code());
      calls_.Record(operation_, stopwatch_.Elapsed(), absl::Status(code, ""));
    }
    methods->Proceed();
  }

 private:
  const std::string operation_;
  CallMetrics& calls_;
  const Stopwatch stopwatch_;
};

class RpcMetrics final : public grpc::experimental::ServerInterceptorFactoryInterface {
 public:
  explicit RpcMetrics(Metrics& metrics) : calls_(metrics, "meshwright_rpc", "gRPC calls answered") {}

  grpc::experimental::Interceptor* CreateServerInterceptor(grpc::experimental::ServerRpcInfo* info) override {
    return new RpcInterceptor(NameOfMethod(info->method()), calls_);
  }

 private:
  CallMetrics calls_;
};

}  // namespace

std::unique_ptr<grpc::experimental::ServerInterceptorFactoryInterface> MakeRpcMetrics(Metrics& metrics) {
  return std::make_unique<RpcMetrics>(metrics);
}

}  // namespace meshwright
