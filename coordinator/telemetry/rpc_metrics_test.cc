// SPDX-License-Identifier: Apache-2.0
#include "coordinator/telemetry/rpc_metrics.h"

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include "meshwright/v1/worker.grpc.pb.h"

namespace meshwright {
namespace {

using testing::HasSubstr;
using testing::Not;

class Workers final : public v1::WorkerService::Service {
 public:
  grpc::Status Synchronize(grpc::ServerContext*, const v1::SynchronizeRequest* request,
                           v1::SynchronizeResponse*) override {
    if (request->worker_id().empty()) return {grpc::StatusCode::INVALID_ARGUMENT, "worker_id is empty"};
    return grpc::Status::OK;
  }
};

TEST(RpcMetricsTest, CallsAreTimedByMethodAndErrorsByCode) {
  Metrics metrics("coordinator");
  Workers workers;
  int port = 0;
  grpc::ServerBuilder builder;
  builder.AddListeningPort("127.0.0.1:0", grpc::InsecureServerCredentials(), &port);
  builder.RegisterService(&workers);
  std::vector<std::unique_ptr<grpc::experimental::ServerInterceptorFactoryInterface>> interceptors;
  interceptors.push_back(MakeRpcMetrics(metrics));
  builder.experimental().SetInterceptorCreators(std::move(interceptors));
  const auto server = builder.BuildAndStart();
  const auto stub = v1::WorkerService::NewStub(
      grpc::CreateChannel("127.0.0.1:" + std::to_string(port), grpc::InsecureChannelCredentials()));
  const auto call = [&](const std::string& worker) {
    grpc::ClientContext context;
    v1::SynchronizeRequest request;
    v1::SynchronizeResponse response;
    request.set_worker_id(worker);
    return stub->Synchronize(&context, request, &response);
  };
  EXPECT_TRUE(call("w").ok());
  EXPECT_THAT(metrics.Text(), Not(HasSubstr("meshwright_rpc_errors_total")));
  EXPECT_TRUE(call("w").ok());
  EXPECT_EQ(call("").error_message(), "worker_id is empty");
  server->Shutdown();
  const std::string text = metrics.Text();
  EXPECT_THAT(text, HasSubstr("meshwright_rpc_seconds_count{operation=\"Synchronize\"} 3\n"));
  EXPECT_THAT(text, HasSubstr("meshwright_rpc_errors_total{code=\"invalid_argument\",operation=\"Synchronize\"} 1\n"));
}

}  // namespace
}  // namespace meshwright
