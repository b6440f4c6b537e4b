// SPDX-License-Identifier: Apache-2.0
#include "clients/cpp/service_client.h"

#include <algorithm>
#include <cstdio>
#include <utility>
#include <vector>

#include <absl/strings/str_cat.h>
#include <grpcpp/grpcpp.h>

#include "meshwright/v1/access.grpc.pb.h"
#include "meshwright/v1/reconstruction.grpc.pb.h"

#include "common/base/clock.h"
#include "common/base/digest.h"
#include "common/base/files.h"
#include "common/base/status_macros.h"

namespace meshwright {
namespace {

constexpr size_t kChunkBytes = size_t{256} << 10;
constexpr absl::Duration kCallDeadline = absl::Seconds(60);
constexpr int kMaxMessageBytes = 64 << 20;
constexpr int kMaxReconnectBackoffMs = 2000;

absl::Status FromGrpc(const grpc::Status& status) {
  if (status.ok()) return absl::OkStatus();
  return {static_cast<absl::StatusCode>(status.error_code()), status.error_message()};
}

class RealServiceClient final : public ServiceClient {
 public:
  RealServiceClient(const std::shared_ptr<grpc::Channel>& channel, std::string key)
      : stub_(v1::ReconstructionService::NewStub(channel)),
        access_stub_(v1::AccessService::NewStub(channel)),
        key_(std::move(key)) {}

  absl::StatusOr<v1::Reconstruction> Create(const v1::CreateReconstructionRequest& request) override {
    v1::CreateReconstructionResponse response;
    MW_RETURN_IF_ERROR(Call(&v1::ReconstructionService::Stub::CreateReconstruction, request, response));
    return response.reconstruction();
  }

  absl::Status Upload(const std::string& id, const std::string& path, const std::string& local_path) override {
    MW_ASSIGN_OR_RETURN(const std::string bytes, ReadFile(local_path));
    grpc::ClientContext context;
    ShowKey(context);
    v1::UploadSceneFileResponse response;
    const auto writer = stub_->UploadSceneFile(&context, &response);
    v1::UploadSceneFileRequest request;
    request.mutable_header()->set_reconstruction_id(id);
    request.mutable_header()->set_path(path);
    request.mutable_header()->set_size_bytes(static_cast<int64_t>(bytes.size()));
    request.mutable_header()->set_sha256(Sha256Hex(bytes));
    bool open = writer->Write(request);
    for (size_t begin = 0; open && begin < bytes.size(); begin += kChunkBytes) {
      request.set_chunk(bytes.substr(begin, kChunkBytes));
      open = writer->Write(request);
    }
    if (open) writer->WritesDone();
    return FromGrpc(writer->Finish());
  }

  absl::StatusOr<v1::ListSceneFilesResponse> ListSceneFiles(const std::string& id) override {
    v1::ListSceneFilesRequest request;
    request.set_id(id);
    v1::ListSceneFilesResponse response;
    MW_RETURN_IF_ERROR(Call(&v1::ReconstructionService::Stub::ListSceneFiles, request, response));
    return response;
  }

  absl::StatusOr<v1::Reconstruction> Start(const std::string& id) override {
    v1::StartReconstructionRequest request;
    request.set_id(id);
    v1::StartReconstructionResponse response;
    MW_RETURN_IF_ERROR(Call(&v1::ReconstructionService::Stub::StartReconstruction, request, response));
    return response.reconstruction();
  }

  absl::StatusOr<v1::Reconstruction> Get(const std::string& id) override {
    v1::GetReconstructionRequest request;
    request.set_id(id);
    v1::GetReconstructionResponse response;
    MW_RETURN_IF_ERROR(Call(&v1::ReconstructionService::Stub::GetReconstruction, request, response));
    return response.reconstruction();
  }

  absl::StatusOr<v1::ListReconstructionsResponse> List(const std::string& page_token) override {
    v1::ListReconstructionsRequest request;
    request.set_page_token(page_token);
    v1::ListReconstructionsResponse response;
    MW_RETURN_IF_ERROR(Call(&v1::ReconstructionService::Stub::ListReconstructions, request, response));
    return response;
  }

  absl::Status Watch(const std::string& id, const std::function<void(const v1::Reconstruction&)>& changed) override {
    grpc::ClientContext context;
    ShowKey(context);
    v1::WatchReconstructionRequest request;
    request.set_id(id);
    const auto reader = stub_->WatchReconstruction(&context, request);
    v1::WatchReconstructionResponse response;
    while (reader->Read(&response)) changed(response.reconstruction());
    return FromGrpc(reader->Finish());
  }

  absl::StatusOr<v1::Reconstruction> Cancel(const std::string& id) override {
    v1::CancelReconstructionRequest request;
    request.set_id(id);
    v1::CancelReconstructionResponse response;
    MW_RETURN_IF_ERROR(Call(&v1::ReconstructionService::Stub::CancelReconstruction, request, response));
    return response.reconstruction();
  }

  absl::Status Delete(const std::string& id) override {
    v1::DeleteReconstructionRequest request;
    request.set_id(id);
    v1::DeleteReconstructionResponse response;
    return Call(&v1::ReconstructionService::Stub::DeleteReconstruction, request, response);
  }

  absl::Status Fetch(const std::string& id, const std::string& path) override {
    MW_ASSIGN_OR_RETURN(const v1::Reconstruction reconstruction, Get(id));
    MW_ASSIGN_OR_RETURN(AtomicFile file, AtomicFile::Create(path));
    grpc::ClientContext context;
    ShowKey(context);
    v1::DownloadMeshRequest request;
    request.set_id(id);
    const auto reader = stub_->DownloadMesh(&context, request);
    v1::DownloadMeshResponse response;
    Sha256Stream digest;
    absl::Status written;
    while (written.ok() && reader->Read(&response)) {
      const std::string& chunk = response.chunk();
      digest.Update(absl::MakeConstSpan(reinterpret_cast<const uint8_t*>(chunk.data()), chunk.size()));
      written = file.Append(chunk);
    }
    if (!written.ok()) {
      context.TryCancel();
      (void)reader->Finish();
      return written;
    }
    MW_RETURN_IF_ERROR(FromGrpc(reader->Finish()));
    if (digest.HexDigest() != reconstruction.mesh_sha256()) {
      return absl::DataLossError("the mesh that arrived does not have the digest that the coordinator names");
    }
    return file.Commit();
  }

  absl::StatusOr<v1::ListPartsResponse> ListParts(const std::string& id) override {
    v1::ListPartsRequest request;
    request.set_id(id);
    v1::ListPartsResponse response;
    MW_RETURN_IF_ERROR(Call(&v1::ReconstructionService::Stub::ListParts, request, response));
    return response;
  }

  absl::StatusOr<std::string> DownloadPart(const std::string& id, const v1::Part& part) override {
    grpc::ClientContext context;
    ShowKey(context);
    v1::DownloadPartRequest request;
    request.set_id(id);
    request.set_sequence(part.sequence());
    const auto reader = stub_->DownloadPart(&context, request);
    v1::DownloadPartResponse response;
    std::string bytes;
    while (reader->Read(&response)) bytes += response.chunk();
    MW_RETURN_IF_ERROR(FromGrpc(reader->Finish()));
    if (Sha256Hex(bytes) != part.sha256()) {
      return absl::DataLossError(
          absl::StrCat("part ", part.sequence(), " arrived without the digest that the coordinator names"));
    }
    return bytes;
  }

  absl::StatusOr<v1::CreateKeyResponse> CreateKey(const v1::CreateKeyRequest& request) override {
    v1::CreateKeyResponse response;
    MW_RETURN_IF_ERROR(CallAccess(&v1::AccessService::Stub::CreateKey, request, response));
    return response;
  }

  absl::StatusOr<v1::ListKeysResponse> ListKeys() override {
    v1::ListKeysResponse response;
    MW_RETURN_IF_ERROR(CallAccess(&v1::AccessService::Stub::ListKeys, v1::ListKeysRequest(), response));
    return response;
  }

  absl::Status RevokeKey(const std::string& id) override {
    v1::RevokeKeyRequest request;
    request.set_id(id);
    v1::RevokeKeyResponse response;
    return CallAccess(&v1::AccessService::Stub::RevokeKey, request, response);
  }

  absl::StatusOr<v1::ListWorkersResponse> ListWorkers() override {
    v1::ListWorkersResponse response;
    MW_RETURN_IF_ERROR(Call(&v1::ReconstructionService::Stub::ListWorkers, v1::ListWorkersRequest(), response));
    return response;
  }

 private:
  void ShowKey(grpc::ClientContext& context) const {
    if (!key_.empty()) context.AddMetadata("authorization", absl::StrCat("Bearer ", key_));
  }

  template <typename Stub, typename Request, typename Response>
  absl::Status CallOn(Stub& stub, grpc::Status (Stub::*method)(grpc::ClientContext*, const Request&, Response*),
                      const Request& request, Response& response) {
    grpc::ClientContext context;
    ShowKey(context);
    context.set_deadline(absl::ToChronoTime(SystemClock().Now() + kCallDeadline));
    return FromGrpc((stub.*method)(&context, request, &response));
  }
  template <typename Method, typename Request, typename Response>
  absl::Status Call(Method method, const Request& request, Response& response) {
    return CallOn(*stub_, method, request, response);
  }
  template <typename Method, typename Request, typename Response>
  absl::Status CallAccess(Method method, const Request& request, Response& response) {
    return CallOn(*access_stub_, method, request, response);
  }

  const std::unique_ptr<v1::ReconstructionService::Stub> stub_;
  const std::unique_ptr<v1::AccessService::Stub> access_stub_;
  const std::string key_;
};

}  // namespace

std::unique_ptr<ServiceClient> ServiceClient::Connect(const std::string& address,
                                                      const ServiceCredentials& credentials) {
  grpc::ChannelArguments arguments;
  arguments.SetMaxReceiveMessageSize(kMaxMessageBytes);
  // Who waits for a coordinator that is being restarted wants to know soon that it is there again.
  arguments.SetInt(GRPC_ARG_MAX_RECONNECT_BACKOFF_MS, kMaxReconnectBackoffMs);
  return std::make_unique<RealServiceClient>(
      grpc::CreateCustomChannel(address,
                                credentials.ca_certificates.empty()
                                    ? grpc::InsecureChannelCredentials()
                                    : grpc::SslCredentials({.pem_root_certs = credentials.ca_certificates}),
                                arguments),
      credentials.key);
}

}  // namespace meshwright
