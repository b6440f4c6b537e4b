// SPDX-License-Identifier: Apache-2.0
#include "coordinator/grpc/grpc_server.h"

#include <algorithm>
#include <cstdio>
#include <optional>
#include <utility>
#include <vector>

#include <absl/cleanup/cleanup.h>
#include <absl/strings/str_cat.h>
#include <grpcpp/ext/proto_server_reflection_plugin.h>
#include <grpcpp/grpcpp.h>
#include <grpcpp/resource_quota.h>
#include <grpcpp/security/tls_certificate_provider.h>
#include <grpcpp/security/tls_credentials_options.h>

#include "meshwright/v1/reconstruction.grpc.pb.h"
#include "meshwright/v1/worker.grpc.pb.h"

#include "common/base/clock.h"
#include "common/base/mutex.h"
#include "common/base/status_macros.h"
#include "common/blob/staged_blob.h"
#include "coordinator/api/guarded_calls.h"
#include "coordinator/grpc/access_service.h"
#include "coordinator/grpc/grpc_gate.h"

namespace meshwright {
namespace {

constexpr int kMaxThreads = 1024;
constexpr int kMaxLongCalls = 512;
constexpr int kMaxLongCallsOfOne = 64;
constexpr unsigned int kReadCertificatesEverySeconds = 10;
constexpr size_t kChunkBytes = size_t{256} << 10;
// Of what a worker makes: nobody may fill the disk.
constexpr int64_t kMaxBlobBytes = int64_t{2} << 30;

template <typename Value, typename Fill>
grpc::Status Answer(const absl::StatusOr<Value>& value, const Fill& fill) {
  if (value.ok()) fill(*value);
  return ToGrpc(value.status());
}

void FillFiles(const std::vector<SceneFile>& files, v1::ListSceneFilesResponse& response) {
  for (const SceneFile& file : files) {
    v1::SceneFile& told = *response.add_files();
    told.set_path(file.path);
    told.set_size_bytes(file.size_bytes);
    told.set_sha256(file.digest);
  }
}

template <typename Response>
absl::Status SendBytes(const std::string& bytes, grpc::ServerWriter<Response>& writer) {
  for (size_t begin = 0; begin < bytes.size(); begin += kChunkBytes) {
    Response response;
    response.set_chunk(bytes.substr(begin, kChunkBytes));
    if (!writer.Write(response)) return absl::CancelledError("the client does not read any more");
  }
  return absl::OkStatus();
}

absl::Status SendFile(const std::string& path, int64_t offset, grpc::ServerWriter<v1::DownloadMeshResponse>& writer) {
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(std::fopen(path.c_str(), "rb"), std::fclose);
  if (file == nullptr) return absl::DataLossError("the mesh's file cannot be read");
  if (offset < 0 || ::fseeko(file.get(), offset, SEEK_SET) != 0) {
    return absl::InvalidArgumentError(absl::StrCat("offset_bytes is ", offset, ", expected >= 0"));
  }
  std::vector<char> buffer(kChunkBytes);
  while (const size_t count = std::fread(buffer.data(), 1, buffer.size(), file.get())) {
    v1::DownloadMeshResponse response;
    response.set_chunk(buffer.data(), count);
    if (!writer.Write(response)) return absl::CancelledError("the client does not read any more");
  }
  return std::ferror(file.get()) != 0 ? absl::DataLossError("the mesh's file cannot be read") : absl::OkStatus();
}

class ReconstructionServiceImpl final : public v1::ReconstructionService::Service {
 public:
  ReconstructionServiceImpl(ReconstructionService& service, WorkerService& workers, Gatekeeper& gate)
      : service_(service), workers_(workers), gate_(gate) {}

  grpc::Status CreateReconstruction(grpc::ServerContext* context, const v1::CreateReconstructionRequest* request,
                                    v1::CreateReconstructionResponse* response) override {
    return Guarded(gate_, *context,
                   {.action = Action::kCreate, .deed = "CreateReconstruction", .reconstruction = request->id()},
                   [&](const Caller& caller) {
                     return Answer(CreateFor(caller, gate_, service_, *request),
                                   [&](const auto& value) { *response->mutable_reconstruction() = value; });
                   });
  }
  grpc::Status UploadSceneFile(grpc::ServerContext* context, grpc::ServerReader<v1::UploadSceneFileRequest>* reader,
                               v1::UploadSceneFileResponse*) override {
    // Who shows no valid key is not waited for.
    const absl::StatusOr<Caller> caller = Identify(gate_, *context);
    if (!caller.ok()) return ToGrpc(caller.status());
    return ToGrpc(long_calls_.Run(NameFor(*caller), [&] { return Upload(*caller, *reader); }));
  }
  grpc::Status ListSceneFiles(grpc::ServerContext* context, const v1::ListSceneFilesRequest* request,
                              v1::ListSceneFilesResponse* response) override {
    return Guarded(gate_, *context,
                   {.action = Action::kRead, .deed = "ListSceneFiles", .reconstruction = request->id()},
                   [&](const Caller&) {
                     return Answer(service_.ListSceneFiles(request->id()),
                                   [&](const std::vector<SceneFile>& files) { FillFiles(files, *response); });
                   });
  }
  grpc::Status StartReconstruction(grpc::ServerContext* context, const v1::StartReconstructionRequest* request,
                                   v1::StartReconstructionResponse* response) override {
    return Guarded(gate_, *context,
                   {.action = Action::kChange, .deed = "StartReconstruction", .reconstruction = request->id()},
                   [&](const Caller&) {
                     return Answer(service_.Start(request->id()),
                                   [&](const auto& value) { *response->mutable_reconstruction() = value; });
                   });
  }
  grpc::Status GetReconstruction(grpc::ServerContext* context, const v1::GetReconstructionRequest* request,
                                 v1::GetReconstructionResponse* response) override {
    return Guarded(gate_, *context,
                   {.action = Action::kRead, .deed = "GetReconstruction", .reconstruction = request->id()},
                   [&](const Caller&) {
                     return Answer(service_.Get(request->id()),
                                   [&](const auto& value) { *response->mutable_reconstruction() = value; });
                   });
  }
  grpc::Status ListReconstructions(grpc::ServerContext* context, const v1::ListReconstructionsRequest* request,
                                   v1::ListReconstructionsResponse* response) override {
    return Guarded(gate_, *context, {.action = Action::kList, .deed = "ListReconstructions"},
                   [&](const Caller& caller) {
                     return Answer(ListFor(caller, service_, *request), [&](const auto& value) { *response = value; });
                   });
  }
  grpc::Status WatchReconstruction(grpc::ServerContext* context, const v1::WatchReconstructionRequest* request,
                                   grpc::ServerWriter<v1::WatchReconstructionResponse>* writer) override {
    return Guarded(gate_, *context,
                   {.action = Action::kRead, .deed = "WatchReconstruction", .reconstruction = request->id()},
                   [&](const Caller& caller) {
                     return ToGrpc(long_calls_.Run(NameFor(caller), [&] {
                       return service_.Watch(
                           request->id(), [&] { return context->IsCancelled(); },
                           [&](const v1::Reconstruction& reconstruction) {
                             v1::WatchReconstructionResponse response;
                             *response.mutable_reconstruction() = reconstruction;
                             return writer->Write(response);
                           });
                     }));
                   });
  }
  grpc::Status CancelReconstruction(grpc::ServerContext* context, const v1::CancelReconstructionRequest* request,
                                    v1::CancelReconstructionResponse* response) override {
    return Guarded(gate_, *context,
                   {.action = Action::kChange, .deed = "CancelReconstruction", .reconstruction = request->id()},
                   [&](const Caller&) {
                     return Answer(service_.Cancel(request->id()),
                                   [&](const auto& value) { *response->mutable_reconstruction() = value; });
                   });
  }
  grpc::Status DeleteReconstruction(grpc::ServerContext* context, const v1::DeleteReconstructionRequest* request,
                                    v1::DeleteReconstructionResponse*) override {
    return Guarded(gate_, *context,
                   {.action = Action::kChange, .deed = "DeleteReconstruction", .reconstruction = request->id()},
                   [&](const Caller&) { return ToGrpc(service_.Delete(request->id())); });
  }
  grpc::Status ListCameras(grpc::ServerContext* context, const v1::ListCamerasRequest* request,
                           v1::ListCamerasResponse* response) override {
    return Guarded(gate_, *context, {.action = Action::kRead, .deed = "ListCameras", .reconstruction = request->id()},
                   [&](const Caller&) {
                     return Answer(service_.ListCameras(request->id()), [&](const auto& value) { *response = value; });
                   });
  }
  grpc::Status GetIncidence(grpc::ServerContext* context, const v1::GetIncidenceRequest* request,
                            v1::GetIncidenceResponse* response) override {
    return Guarded(gate_, *context, {.action = Action::kRead, .deed = "GetIncidence", .reconstruction = request->id()},
                   [&](const Caller&) {
                     return Answer(service_.GetIncidence(request->id()), [&](const auto& value) { *response = value; });
                   });
  }
  grpc::Status ListParts(grpc::ServerContext* context, const v1::ListPartsRequest* request,
                         v1::ListPartsResponse* response) override {
    return Guarded(gate_, *context, {.action = Action::kRead, .deed = "ListParts", .reconstruction = request->id()},
                   [&](const Caller&) {
                     return Answer(service_.ListParts(request->id(), request->after()),
                                   [&](const auto& value) { *response = value; });
                   });
  }
  grpc::Status DownloadMesh(grpc::ServerContext* context, const v1::DownloadMeshRequest* request,
                            grpc::ServerWriter<v1::DownloadMeshResponse>* writer) override {
    return Guarded(gate_, *context, {.action = Action::kRead, .deed = "DownloadMesh", .reconstruction = request->id()},
                   [&](const Caller&) {
                     const absl::StatusOr<std::string> path = service_.MeshPath(request->id());
                     return ToGrpc(path.ok() ? SendFile(*path, request->offset_bytes(), *writer) : path.status());
                   });
  }
  grpc::Status DownloadPart(grpc::ServerContext* context, const v1::DownloadPartRequest* request,
                            grpc::ServerWriter<v1::DownloadPartResponse>* writer) override {
    return Guarded(gate_, *context, {.action = Action::kRead, .deed = "DownloadPart", .reconstruction = request->id()},
                   [&](const Caller&) {
                     const absl::StatusOr<std::string> bytes = service_.PartBytes(request->id(), request->sequence());
                     return ToGrpc(bytes.ok() ? SendBytes(*bytes, *writer) : bytes.status());
                   });
  }
  grpc::Status ListAttempts(grpc::ServerContext* context, const v1::ListAttemptsRequest* request,
                            v1::ListAttemptsResponse* response) override {
    return Guarded(gate_, *context, {.action = Action::kRead, .deed = "ListAttempts", .reconstruction = request->id()},
                   [&](const Caller&) {
                     return Answer(service_.ListAttempts(*request), [&](const auto& value) { *response = value; });
                   });
  }
  grpc::Status ListWorkers(grpc::ServerContext* context, const v1::ListWorkersRequest*,
                           v1::ListWorkersResponse* response) override {
    return Guarded(gate_, *context, {.action = Action::kInspect, .deed = "ListWorkers"}, [&](const Caller&) {
      *response = workers_.ListWorkers();
      return grpc::Status::OK;
    });
  }

 private:
  // Where nobody shows a key, callers are told apart by where they are.
  std::string NameFor(const Caller& caller) const { return gate_.is_open() ? caller.address : caller.user; }

  absl::Status Upload(const Caller& caller, grpc::ServerReader<v1::UploadSceneFileRequest>& reader) {
    v1::UploadSceneFileRequest request;
    if (!reader.Read(&request) || !request.has_header()) {
      return absl::InvalidArgumentError("header: expected in the first message");
    }
    const std::string& id = request.header().reconstruction_id();
    MW_RETURN_IF_ERROR(
        gate_.Check(caller, {.action = Action::kChange, .deed = "UploadSceneFile", .reconstruction = id}));
    const v1::UploadSceneFileRequest::Header header = request.header();
    MW_ASSIGN_OR_RETURN(SceneFileUpload upload, service_.BeginUpload(header));
    MW_RETURN_IF_ERROR(gate_.ReserveSceneBytes(header.reconstruction_id(), header.path(), header.size_bytes()));
    const auto release = absl::MakeCleanup([&] { gate_.ReleaseSceneBytes(header.reconstruction_id(), header.path()); });
    while (reader.Read(&request)) {
      if (!request.has_chunk()) return absl::InvalidArgumentError("chunk: expected in all messages but the first");
      MW_RETURN_IF_ERROR(upload.Append(request.chunk()));
    }
    return upload.Finish();
  }

  ReconstructionService& service_;
  WorkerService& workers_;
  Gatekeeper& gate_;
  LongCalls long_calls_{kMaxLongCalls, kMaxLongCallsOfOne};
};

WorkerIdentity IdentityOf(const Gatekeeper& gate, const Caller& caller) {
  if (gate.is_open()) return {};
  return {.owner = absl::StrCat(caller.certified_names.empty() ? "user " : "certificate ", caller.user),
          .names = caller.certified_names};
}

// A call that waits for work waits without a thread of its own: the service answers it when there is something to say.
class WaitingWorker final : public grpc::ServerUnaryReactor {
 public:
  // `refused` is told when it is not the worker that it says to be.
  WaitingWorker(WorkerService& service, const WorkerIdentity& identity, std::function<void(absl::Status)> refused,
                const v1::SynchronizeRequest& request, v1::SynchronizeResponse& response)
      : service_(service) {
    const auto answered = [this, refused = std::move(refused),
                           &response](absl::StatusOr<v1::SynchronizeResponse> answer) {
      if (absl::IsPermissionDenied(answer.status())) refused(answer.status());
      if (answer.ok()) response = *std::move(answer);
      Finish(ToGrpc(answer.status()));
    };
    call_ = service_.Synchronize(request, answered, identity);
    {
      const MutexLock lock(mutex_);
      is_known_ = true;
      if (!is_cancelled_) return;
    }
    service_.Abandon(call_);
  }

  // Neither comes before the constructor has ended and both may come at any time after it; the answer, from the
  // service's thread, may come within it.
  void OnCancel() override {
    {
      const MutexLock lock(mutex_);
      is_cancelled_ = true;
      if (!is_known_) return;
    }
    service_.Abandon(call_);
  }
  void OnDone() override { delete this; }

 private:
  WorkerService& service_;
  int64_t call_ = 0;
  Mutex mutex_;
  bool is_known_ ABSL_GUARDED_BY(mutex_) = false;
  bool is_cancelled_ ABSL_GUARDED_BY(mutex_) = false;
};

class WorkerServiceImpl final : public v1::WorkerService::WithCallbackMethod_Synchronize<v1::WorkerService::Service> {
 public:
  WorkerServiceImpl(WorkerService& service, BlobStore& blobs, std::string staging_folder, Gatekeeper& gate)
      : service_(service), blobs_(blobs), staging_folder_(std::move(staging_folder)), gate_(gate) {}

  grpc::ServerUnaryReactor* Synchronize(grpc::CallbackServerContext* context, const v1::SynchronizeRequest* request,
                                        v1::SynchronizeResponse* response) override {
    const Request deed = {.action = Action::kWork, .deed = "Synchronize"};
    const absl::StatusOr<Caller> caller = Enter(gate_, *context, deed);
    if (!caller.ok()) {
      grpc::ServerUnaryReactor* const refused = context->DefaultReactor();
      refused->Finish(ToGrpc(caller.status()));
      return refused;
    }
    const auto refused = [this, deed, caller = *caller](absl::Status why) {
      gate_.Refused(caller, deed, std::move(why)).IgnoreError();
    };
    return new WaitingWorker(service_, IdentityOf(gate_, *caller), refused, *request, *response);
  }
  grpc::Status FetchBlob(grpc::ServerContext* context, const v1::FetchBlobRequest* request,
                         grpc::ServerWriter<v1::FetchBlobResponse>* writer) override {
    return Guarded(gate_, *context, {.action = Action::kWork, .deed = "FetchBlob"}, [&](const Caller&) {
      const absl::StatusOr<std::string> bytes = blobs_.Get(request->digest());
      return ToGrpc(bytes.ok() ? SendBytes(*bytes, *writer) : bytes.status());
    });
  }
  grpc::Status PutBlob(grpc::ServerContext* context, grpc::ServerReader<v1::PutBlobRequest>* reader,
                       v1::PutBlobResponse* response) override {
    return Guarded(gate_, *context, {.action = Action::kWork, .deed = "PutBlob"}, [&](const Caller&) {
      return Answer(Put(*reader), [&](const std::string& digest) { response->set_digest(digest); });
    });
  }

 private:
  absl::StatusOr<std::string> Put(grpc::ServerReader<v1::PutBlobRequest>& reader) {
    v1::PutBlobRequest request;
    if (!reader.Read(&request) || request.content_case() != v1::PutBlobRequest::kDigest) {
      return absl::InvalidArgumentError("digest: expected in the first message");
    }
    const std::string expected = request.digest();
    MW_RETURN_IF_ERROR(ValidateDigest(expected));
    MW_ASSIGN_OR_RETURN(const std::string path, StagedBlob::NewPath(staging_folder_));
    const auto remove = absl::MakeCleanup([&] { std::remove(path.c_str()); });
    MW_ASSIGN_OR_RETURN(const std::unique_ptr<StagedBlob> staged, StagedBlob::Open(path));
    while (reader.Read(&request)) {
      const std::string& chunk = request.chunk();
      if (staged->size_bytes() + static_cast<int64_t>(chunk.size()) > kMaxBlobBytes) {
        return absl::InvalidArgumentError(absl::StrCat("chunk: more than ", kMaxBlobBytes, " bytes"));
      }
      MW_RETURN_IF_ERROR(
          staged->Append(absl::MakeConstSpan(reinterpret_cast<const uint8_t*>(chunk.data()), chunk.size())));
    }
    if (const std::string digest = staged->HexDigest(); digest != expected) {
      return absl::InvalidArgumentError(absl::StrCat("digest is ", expected, ", the bytes have ", digest));
    }
    MW_RETURN_IF_ERROR(staged->Sync());
    MW_RETURN_IF_ERROR(staged->Adopt(blobs_));
    return expected;
  }

  WorkerService& service_;
  BlobStore& blobs_;
  const std::string staging_folder_;
  Gatekeeper& gate_;
};

std::shared_ptr<grpc::ServerCredentials> CredentialsOf(const GrpcServerOptions& options) {
  if (options.tls_certificate_file.empty()) return grpc::InsecureServerCredentials();
  const auto provider = std::make_shared<grpc::experimental::FileWatcherCertificateProvider>(
      options.tls_key_file, options.tls_certificate_file, options.client_ca_file, kReadCertificatesEverySeconds);
  grpc::experimental::TlsServerCredentialsOptions tls(provider);
  tls.watch_identity_key_cert_pairs();
  if (!options.client_ca_file.empty()) {
    tls.watch_root_certs();
    // Who shows none may still show a key; one that nobody of the file has signed ends the connection.
    tls.set_cert_request_type(GRPC_SSL_REQUEST_CLIENT_CERTIFICATE_AND_VERIFY);
  }
  return grpc::experimental::TlsServerCredentials(tls);
}

class RealGrpcServer final : public GrpcServer {
 public:
  RealGrpcServer(ReconstructionService& reconstructions, WorkerService& workers, BlobStore& blobs, Gatekeeper& gate)
      : reconstructions_(reconstructions),
        workers_(workers),
        reconstruction_service_impl_(reconstructions, workers, gate),
        worker_service_impl_(workers, blobs, reconstructions.staging_folder(), gate),
        access_service_(MakeAccessService(gate)) {}
  ~RealGrpcServer() override { Shutdown(absl::Seconds(1)); }

  absl::Status Listen(const GrpcServerOptions& options, GrpcServer::Interceptors interceptors) {
    grpc::EnableDefaultHealthCheckService(true);
    if (options.reflection) grpc::reflection::InitProtoReflectionServerBuilderPlugin();
    grpc::ServerBuilder builder;
    builder.AddListeningPort(options.listen, CredentialsOf(options), &port_);
    // Beyond these, calls are answered with ResourceExhausted.
    grpc::ResourceQuota quota;
    quota.SetMaxThreads(kMaxThreads);
    builder.SetResourceQuota(quota);
    // Two coordinators on one port would each get half of the calls.
    builder.AddChannelArgument(GRPC_ARG_ALLOW_REUSEPORT, 0);
    builder.AddChannelArgument(GRPC_ARG_HTTP2_MIN_RECV_PING_INTERVAL_WITHOUT_DATA_MS, 5000);
    builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_PERMIT_WITHOUT_CALLS, 1);
    if (!interceptors.empty()) builder.experimental().SetInterceptorCreators(std::move(interceptors));
    builder.RegisterService(&reconstruction_service_impl_);
    builder.RegisterService(&worker_service_impl_);
    builder.RegisterService(access_service_.get());
    server_ = builder.BuildAndStart();
    if (server_ == nullptr || port_ == 0) {
      return absl::UnavailableError(absl::StrCat("cannot listen on ", options.listen));
    }
    return absl::OkStatus();
  }

  int port() const override { return port_; }

  void Shutdown(absl::Duration deadline) override {
    if (server_ == nullptr) return;
    workers_.Shutdown();
    reconstructions_.Shutdown();
    server_->Shutdown(absl::ToChronoTime(SystemClock().Now() + deadline));
    server_->Wait();
    server_.reset();
  }

 private:
  ReconstructionService& reconstructions_;
  WorkerService& workers_;
  ReconstructionServiceImpl reconstruction_service_impl_;
  WorkerServiceImpl worker_service_impl_;
  const std::unique_ptr<grpc::Service> access_service_;
  int port_ = 0;
  std::unique_ptr<grpc::Server> server_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<GrpcServer>> GrpcServer::Start(const GrpcServerOptions& options,
                                                              ReconstructionService& reconstructions,
                                                              WorkerService& workers, BlobStore& blobs,
                                                              Gatekeeper& gate, Interceptors interceptors) {
  auto server = std::make_unique<RealGrpcServer>(reconstructions, workers, blobs, gate);
  MW_RETURN_IF_ERROR(server->Listen(options, std::move(interceptors)));
  return server;
}

}  // namespace meshwright
