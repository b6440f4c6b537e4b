// SPDX-License-Identifier: Apache-2.0
// Who may call over gRPC: with --api-token-file nobody without a key, whatever the method.

#include <gmock/gmock.h>
#include <grpcpp/generic/generic_stub.h>
#include <grpcpp/grpcpp.h>

#include "meshwright/v1/access.pb.h"
#include "meshwright/v1/reconstruction.pb.h"
#include "meshwright/v1/worker.pb.h"

#include "common/base/clock.h"
#include "tests/rest/rest_cluster.h"

namespace meshwright {
namespace {

constexpr char kToken[] = "a-token-of-32-characters-or-so--";

class GrpcTokenTest : public RestCluster {
 protected:
  void SetUp() override {
    const std::string file = testing::TempDir() + "grpc_token";
    MW_CHECK(WriteFileAtomically(file, std::string(kToken) + "\n").ok());
    settings_.api_token_file = file;
    settings_.user_requests_per_second = 100'000;
    RestCluster::SetUp();
    address_ = absl::StrCat("127.0.0.1:", coordinator_->port());
  }

  // A call of any kind with one empty message.
  grpc::Status Call(const std::string& method, const std::string& authorization) const {
    grpc::GenericStub stub(grpc::CreateChannel(address_, grpc::InsecureChannelCredentials()));
    grpc::ClientContext context;
    context.set_deadline(absl::ToChronoTime(SystemClock().Now() + absl::Seconds(20)));
    if (!authorization.empty()) context.AddMetadata("authorization", authorization);
    grpc::CompletionQueue queue;
    const auto call = stub.PrepareCall(&context, method, &queue);
    void* tag = nullptr;
    bool is_good = false;
    call->StartCall(&queue);
    queue.Next(&tag, &is_good);
    const grpc::Slice nothing("");
    call->WriteLast(grpc::ByteBuffer(&nothing, 1), grpc::WriteOptions(), &queue);
    queue.Next(&tag, &is_good);
    grpc::ByteBuffer answer;
    call->Read(&answer, &queue);
    queue.Next(&tag, &is_good);
    grpc::Status status;
    call->Finish(&status, &queue);
    queue.Next(&tag, &is_good);
    return status;
  }

  std::string address_;
};

TEST_F(GrpcTokenTest, NoMethodAnswersWithoutIt) {
  int methods = 0;
  for (const google::protobuf::FileDescriptor* file :
       {v1::Reconstruction::descriptor()->file(), v1::SynchronizeRequest::descriptor()->file(),
        v1::Key::descriptor()->file()}) {
    for (int s = 0; s < file->service_count(); ++s) {
      for (int m = 0; m < file->service(s)->method_count(); ++m, ++methods) {
        const std::string method =
            absl::StrCat("/", file->service(s)->full_name(), "/", file->service(s)->method(m)->name());
        for (const std::string& authorization : {std::string(), std::string("Bearer "), std::string("Bearer wrong"),
                                                 std::string(kToken), absl::StrCat("Bearer ", kToken, "x")}) {
          EXPECT_EQ(Call(method, authorization).error_code(), grpc::StatusCode::UNAUTHENTICATED)
              << method << " with \"" << authorization << "\"";
        }
      }
    }
  }
  EXPECT_GE(methods, 21);
  // Probes of orchestrators have no token.
  EXPECT_TRUE(Call("/grpc.health.v1.Health/Check", "").ok());
}

}  // namespace
}  // namespace meshwright
