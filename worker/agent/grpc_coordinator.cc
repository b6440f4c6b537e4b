// SPDX-License-Identifier: Apache-2.0
#include "worker/agent/grpc_coordinator.h"

#include <utility>

#include <absl/strings/str_cat.h>
#include <grpcpp/grpcpp.h>

#include "meshwright/v1/worker.grpc.pb.h"

#include "common/base/clock.h"
#include "common/base/digest.h"
#include "common/base/mutex.h"
#include "common/base/status_macros.h"

namespace meshwright {
namespace {

constexpr size_t kChunkBytes = size_t{256} << 10;
constexpr int kMaxMessageBytes = 64 << 20;
// Added to the wait timeout that a request asks for.
constexpr double kAnswerSeconds = 10;
constexpr absl::Duration kBlobDeadline = absl::Minutes(10);

absl::Status FromGrpc(const grpc::Status& status) {
  if (status.ok()) return absl::OkStatus();
  return {static_cast<absl::StatusCode>(status.error_code()), status.error_message()};
}

class RealGrpcCoordinator final : public GrpcCoordinator {
 public:
  RealGrpcCoordinator(const std::shared_ptr<grpc::Channel>& channel, std::string key)
      : stub_(v1::WorkerService::NewStub(channel)), key_(std::move(key)) {}

  absl::StatusOr<v1::SynchronizeResponse> Synchronize(const v1::SynchronizeRequest& request) override {
    grpc::ClientContext context;
    ShowKey(context);
    context.set_deadline(
        absl::ToChronoTime(SystemClock().Now() + absl::Seconds(request.wait_timeout_seconds() + kAnswerSeconds)));
    {
      const MutexLock lock(mutex_);
      if (std::exchange(interrupted_, false)) return absl::CancelledError("interrupted");
      waiting_ = &context;
    }
    v1::SynchronizeResponse response;
    const grpc::Status status = stub_->Synchronize(&context, request, &response);
    {
      const MutexLock lock(mutex_);
      waiting_ = nullptr;
    }
    if (!status.ok()) return FromGrpc(status);
    return response;
  }

  void Interrupt() override {
    const MutexLock lock(mutex_);
    if (waiting_ != nullptr) {
      waiting_->TryCancel();
    } else {
      interrupted_ = true;
    }
  }

  absl::StatusOr<std::string> Put(const std::string& bytes) override {
    grpc::ClientContext context;
    ShowKey(context);
    context.set_deadline(absl::ToChronoTime(SystemClock().Now() + kBlobDeadline));
    v1::PutBlobResponse response;
    const auto writer = stub_->PutBlob(&context, &response);
    v1::PutBlobRequest request;
    request.set_digest(Sha256Hex(bytes));
    bool open = writer->Write(request);
    for (size_t begin = 0; open && begin < bytes.size(); begin += kChunkBytes) {
      request.set_chunk(bytes.substr(begin, kChunkBytes));
      open = writer->Write(request);
    }
    if (open) writer->WritesDone();
    MW_RETURN_IF_ERROR(FromGrpc(writer->Finish()));
    return response.digest();
  }

  absl::StatusOr<std::string> Get(const std::string& digest) override {
    MW_RETURN_IF_ERROR(ValidateDigest(digest));
    grpc::ClientContext context;
    ShowKey(context);
    context.set_deadline(absl::ToChronoTime(SystemClock().Now() + kBlobDeadline));
    v1::FetchBlobRequest request;
    request.set_digest(digest);
    const auto reader = stub_->FetchBlob(&context, request);
    v1::FetchBlobResponse response;
    std::string bytes;
    while (reader->Read(&response)) bytes += response.chunk();
    MW_RETURN_IF_ERROR(FromGrpc(reader->Finish()));
    if (Sha256Hex(bytes) != digest) {
      return absl::DataLossError(absl::StrCat("blob ", digest, ": other bytes arrived from the coordinator"));
    }
    return bytes;
  }

  absl::StatusOr<bool> Has(const std::string&) override {
    return absl::UnimplementedError("workers do not ask the coordinator which blobs there are");
  }
  absl::Status Delete(const std::string&) override {
    return absl::UnimplementedError("workers delete no blobs of the coordinator");
  }

 private:
  void ShowKey(grpc::ClientContext& context) const {
    if (!key_.empty()) context.AddMetadata("authorization", absl::StrCat("Bearer ", key_));
  }

  const std::unique_ptr<v1::WorkerService::Stub> stub_;
  const std::string key_;
  Mutex mutex_;
  grpc::ClientContext* waiting_ ABSL_GUARDED_BY(mutex_) = nullptr;
  bool interrupted_ ABSL_GUARDED_BY(mutex_) = false;
};

}  // namespace

std::unique_ptr<GrpcCoordinator> GrpcCoordinator::Connect(const std::string& address,
                                                          const CoordinatorCredentials& credentials) {
  grpc::ChannelArguments arguments;
  arguments.SetMaxReceiveMessageSize(kMaxMessageBytes);
  arguments.SetInt(GRPC_ARG_KEEPALIVE_TIME_MS, 10'000);
  arguments.SetInt(GRPC_ARG_KEEPALIVE_TIMEOUT_MS, 10'000);
  // A coordinator that was started anew is found within seconds.
  arguments.SetInt(GRPC_ARG_MAX_RECONNECT_BACKOFF_MS, 2'000);
  return std::make_unique<RealGrpcCoordinator>(
      grpc::CreateCustomChannel(address,
                                credentials.ca_certificates.empty()
                                    ? grpc::InsecureChannelCredentials()
                                    : grpc::SslCredentials({.pem_root_certs = credentials.ca_certificates,
                                                            .pem_private_key = credentials.private_key,
                                                            .pem_cert_chain = credentials.certificate}),
                                arguments),
      credentials.key);
}

}  // namespace meshwright
