// SPDX-License-Identifier: Apache-2.0
#include "coordinator/grpc/grpc_server.h"

#include <atomic>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <future>
#include <thread>

#include <absl/strings/str_cat.h>
#include <gmock/gmock.h>
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include "meshwright/v1/reconstruction.grpc.pb.h"
#include "meshwright/v1/worker.grpc.pb.h"

#include "common/base/check.h"
#include "common/base/clock.h"
#include "common/base/digest.h"
#include "common/base/thread_pool.h"
#include "common/blob/filesystem_blob_store.h"
#include "coordinator/store/sqlite_job_store.h"

namespace meshwright {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

// A coordinator behind its port, and clients of both services.
class GrpcServerTest : public testing::Test {
 protected:
  void SetUp() override {
    std::string pattern = testing::TempDir() + "grpc_XXXXXX";
    MW_CHECK(mkdtemp(pattern.data()) != nullptr);
    folder_ = pattern;
    fs::create_directories(folder_ + "/roots/nothing");
    blobs_ = *FilesystemBlobStore::Open(folder_ + "/blobs");
    store_ = *OpenSqliteJobStore(folder_ + "/state.sqlite");
    workers_ = std::make_unique<WorkerService>(LeaseOptions(), RetryOptions(), *store_);
    auto service = ReconstructionService::Open({.data_folder = folder_ + "/data", .scene_roots = {folder_ + "/roots"}},
                                               {.store = store_.get(),
                                                .blobs = blobs_.get(),
                                                .clock = &clock_,
                                                .pool = &pool_,
                                                .jobs_changed = [this] { workers_->Wake(); },
                                                .parse_config = ParseOptions},
                                               *workers_);
    ASSERT_TRUE(service.ok()) << service.status();
    service_ = *std::move(service);
    gate_ = std::make_unique<Gatekeeper>(GatekeeperOptions(), *store_, clock_);  // nobody has to show a key
    auto server = GrpcServer::Start({.listen = "127.0.0.1:0"}, *service_, *workers_, *blobs_, *gate_);
    ASSERT_TRUE(server.ok()) << server.status();
    server_ = *std::move(server);
    const auto channel =
        grpc::CreateChannel(absl::StrCat("127.0.0.1:", server_->port()), grpc::InsecureChannelCredentials());
    reconstructions_ = v1::ReconstructionService::NewStub(channel);
    worker_ = v1::WorkerService::NewStub(channel);
  }
  void TearDown() override {
    server_.reset();
    service_.reset();
    workers_.reset();
    fs::remove_all(folder_);
  }

  static absl::StatusOr<ReconstructionConfig> ParseOptions(const std::string& options_json) {
    if (options_json == "bad") return absl::InvalidArgumentError("options_json: bad");
    return ReconstructionConfig{.options_json = options_json.empty() ? "{}" : options_json,
                                .job_bytes = [](const CameraJobSpec&, const std::vector<Camera>&) { return 1; }};
  }

  grpc::Status Create(const std::string& id, const std::string& options = "", const std::string& scene = "") {
    grpc::ClientContext context;
    v1::CreateReconstructionRequest request;
    request.set_id(id);
    request.set_options_json(options);
    request.set_scene_reference(scene);
    v1::CreateReconstructionResponse response;
    return reconstructions_->CreateReconstruction(&context, request, &response);
  }
  grpc::Status Get(const std::string& id) {
    grpc::ClientContext context;
    v1::GetReconstructionRequest request;
    request.set_id(id);
    v1::GetReconstructionResponse response;
    return reconstructions_->GetReconstruction(&context, request, &response);
  }
  grpc::Status Cancel(const std::string& id) {
    grpc::ClientContext context;
    v1::CancelReconstructionRequest request;
    request.set_id(id);
    v1::CancelReconstructionResponse response;
    return reconstructions_->CancelReconstruction(&context, request, &response);
  }

  static v1::UploadSceneFileRequest Header(const std::string& id, const std::string& bytes) {
    v1::UploadSceneFileRequest request;
    request.mutable_header()->set_reconstruction_id(id);
    request.mutable_header()->set_path("images/a.png");
    request.mutable_header()->set_size_bytes(static_cast<int64_t>(bytes.size()));
    request.mutable_header()->set_sha256(Sha256Hex(bytes));
    return request;
  }
  static v1::UploadSceneFileRequest Chunk(const std::string& bytes) {
    v1::UploadSceneFileRequest request;
    request.set_chunk(bytes);
    return request;
  }
  grpc::Status Upload(const std::vector<v1::UploadSceneFileRequest>& messages) {
    grpc::ClientContext context;
    v1::UploadSceneFileResponse response;
    const auto writer = reconstructions_->UploadSceneFile(&context, &response);
    for (const auto& message : messages) {
      if (!writer->Write(message)) break;
    }
    writer->WritesDone();
    return writer->Finish();
  }

  static v1::PutBlobRequest Digest(const std::string& digest) {
    v1::PutBlobRequest request;
    request.set_digest(digest);
    return request;
  }
  static v1::PutBlobRequest Piece(const std::string& bytes) {
    v1::PutBlobRequest request;
    request.set_chunk(bytes);
    return request;
  }
  grpc::Status Put(const std::vector<v1::PutBlobRequest>& messages) {
    grpc::ClientContext context;
    v1::PutBlobResponse response;
    const auto writer = worker_->PutBlob(&context, &response);
    for (const auto& message : messages) {
      if (!writer->Write(message)) break;
    }
    writer->WritesDone();
    return writer->Finish();
  }
  grpc::Status Fetch(const std::string& digest, std::vector<std::string>* chunks) {
    grpc::ClientContext context;
    v1::FetchBlobRequest request;
    request.set_digest(digest);
    const auto reader = worker_->FetchBlob(&context, request);
    v1::FetchBlobResponse response;
    while (reader->Read(&response)) chunks->push_back(response.chunk());
    return reader->Finish();
  }

  static v1::SynchronizeRequest Worker(const std::string& id, double wait_seconds) {
    v1::SynchronizeRequest request;
    request.set_worker_id(id);
    request.set_instance("1");
    request.set_cores(1);
    request.set_memory_bytes(1000);
    request.set_wait_timeout_seconds(wait_seconds);
    return request;
  }
  grpc::Status Synchronize(grpc::ClientContext& context, const v1::SynchronizeRequest& request) {
    v1::SynchronizeResponse response;
    return worker_->Synchronize(&context, request, &response);
  }

  // Waits until `what` holds, for some seconds at most.
  static bool Eventually(const std::function<bool()>& what) {
    for (int i = 0; i < 500; ++i) {
      if (what()) return true;
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
    return false;
  }

  std::string folder_;
  RealClock clock_;
  ThreadPool pool_{1};
  std::unique_ptr<BlobStore> blobs_;
  std::unique_ptr<JobStore> store_;
  std::unique_ptr<WorkerService> workers_;
  std::unique_ptr<ReconstructionService> service_;
  std::unique_ptr<Gatekeeper> gate_;
  std::unique_ptr<GrpcServer> server_;
  std::unique_ptr<v1::ReconstructionService::Stub> reconstructions_;
  std::unique_ptr<v1::WorkerService::Stub> worker_;
};

TEST_F(GrpcServerTest, ErrorsAreTheServicesWithTheirWords) {
  EXPECT_EQ(Get("nobody").error_code(), grpc::StatusCode::NOT_FOUND);
  EXPECT_THAT(Get("nobody").error_message(), HasSubstr("nobody"));
  EXPECT_EQ(Create("Not An Id").error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  const grpc::Status options = Create("castle", "bad");
  EXPECT_EQ(options.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(options.error_message(), "options_json: bad");
  ASSERT_TRUE(Create("castle").ok());
  EXPECT_TRUE(Create("castle").ok()) << "the same again";
  EXPECT_EQ(Create("castle", R"({"window":1})").error_code(), grpc::StatusCode::ALREADY_EXISTS);
  EXPECT_EQ(Create("ruin", "", "file:../..").error_code(), grpc::StatusCode::INVALID_ARGUMENT);

  grpc::ClientContext context;
  v1::DownloadMeshRequest mesh;
  mesh.set_id("castle");
  v1::DownloadMeshResponse none;
  const auto reader = reconstructions_->DownloadMesh(&context, mesh);
  EXPECT_FALSE(reader->Read(&none));
  EXPECT_EQ(reader->Finish().error_code(), grpc::StatusCode::FAILED_PRECONDITION);
}

TEST_F(GrpcServerTest, AFileIsThereWholeOrNotAtAll) {
  ASSERT_TRUE(Create("castle").ok());
  const std::string bytes(300'000, 'x');
  const auto refused = [&](const std::vector<v1::UploadSceneFileRequest>& messages, const std::string& word) {
    const grpc::Status status = Upload(messages);
    EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT) << status.error_message();
    EXPECT_THAT(status.error_message(), HasSubstr(word));
    EXPECT_TRUE(store_->ListSceneFiles("castle")->empty());
  };
  refused({}, "header");
  refused({Chunk(bytes)}, "header");
  refused({Header("castle", bytes), Header("castle", bytes)}, "chunk");
  refused({Header("castle", bytes), Chunk(bytes.substr(1))}, "size_bytes");
  refused({Header("castle", bytes), Chunk(std::string(bytes.size(), 'y'))}, "sha256");
  EXPECT_EQ(Upload({Header("ruin", bytes)}).error_code(), grpc::StatusCode::NOT_FOUND);
  ASSERT_TRUE(Upload({Header("castle", bytes), Chunk(bytes.substr(0, 7)), Chunk(bytes.substr(7))}).ok());
  ASSERT_EQ(store_->ListSceneFiles("castle")->size(), 1);
  EXPECT_EQ(*blobs_->Get(store_->ListSceneFiles("castle")->front().digest), bytes);
  grpc::ClientContext context;
  v1::ListSceneFilesRequest request;
  request.set_id("castle");
  v1::ListSceneFilesResponse response;
  ASSERT_TRUE(reconstructions_->ListSceneFiles(&context, request, &response).ok());
  ASSERT_EQ(response.files_size(), 1);
  EXPECT_EQ(response.files(0).path(), "images/a.png");
  EXPECT_EQ(response.files(0).size_bytes(), 300'000);
  EXPECT_EQ(response.files(0).sha256(), Sha256Hex(bytes));
}

TEST_F(GrpcServerTest, AMessageLargerThanGrpcTakesEndsTheCallAndNothingElse) {
  ASSERT_TRUE(Create("castle").ok());
  const std::string bytes(size_t{5} << 20, 'x');
  EXPECT_EQ(Upload({Header("castle", bytes), Chunk(bytes)}).error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_TRUE(store_->ListSceneFiles("castle")->empty());
  EXPECT_TRUE(Get("castle").ok());
}

TEST_F(GrpcServerTest, BlobsGoBothWaysInPiecesUnderTheirDigest) {
  std::string bytes(700'001, 'a');
  for (size_t i = 0; i < bytes.size(); ++i) bytes[i] = static_cast<char>(i % 251);
  const std::string digest = Sha256Hex(bytes);
  ASSERT_TRUE(Put({Digest(digest), Piece(bytes.substr(0, 5)), Piece(bytes.substr(5))}).ok());
  EXPECT_TRUE(Put({Digest(digest), Piece(bytes)}).ok()) << "the same again";
  std::vector<std::string> chunks;
  ASSERT_TRUE(Fetch(digest, &chunks).ok());
  EXPECT_EQ(chunks.size(), 3);
  std::string back;
  for (const std::string& chunk : chunks) {
    EXPECT_LE(chunk.size(), size_t{256} << 10);
    back += chunk;
  }
  EXPECT_TRUE(back == bytes);
}

TEST_F(GrpcServerTest, WhatIsNoBlobIsRefusedAndLeavesNothing) {
  const std::string digest = Sha256Hex("surface");
  for (const auto& messages : std::vector<std::vector<v1::PutBlobRequest>>{
           {}, {Piece("surface")}, {Digest("../etc/passwd"), Piece("x")}, {Digest(digest), Piece("another")}}) {
    EXPECT_EQ(Put(messages).error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  }
  EXPECT_FALSE(*blobs_->Has(digest));
  EXPECT_FALSE(*blobs_->Has(Sha256Hex("another")));
  std::vector<std::string> chunks;
  EXPECT_EQ(Fetch(digest, &chunks).error_code(), grpc::StatusCode::NOT_FOUND);
  EXPECT_EQ(Fetch("../etc/passwd", &chunks).error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  // Nothing is left of what was on its way.
  int files = 0;
  for (const auto& entry : fs::recursive_directory_iterator(folder_ + "/blobs"))
    files += entry.is_regular_file() ? 1 : 0;
  EXPECT_EQ(files, 0);
}

TEST_F(GrpcServerTest, ADamagedBlobIsDataLoss) {
  const std::string digest = *blobs_->Put("surface");
  for (const auto& entry : fs::recursive_directory_iterator(folder_ + "/blobs")) {
    if (entry.is_regular_file()) std::ofstream(entry.path(), std::ios::trunc) << "surfacE";
  }
  std::vector<std::string> chunks;
  EXPECT_EQ(Fetch(digest, &chunks).error_code(), grpc::StatusCode::DATA_LOSS);
  EXPECT_TRUE(chunks.empty());
}

TEST_F(GrpcServerTest, AWatchTellsEveryStateAndEndsWithTheLast) {
  ASSERT_TRUE(Create("castle").ok());
  grpc::ClientContext context;
  v1::WatchReconstructionRequest request;
  request.set_id("castle");
  const auto reader = reconstructions_->WatchReconstruction(&context, request);
  v1::WatchReconstructionResponse response;
  ASSERT_TRUE(reader->Read(&response));
  EXPECT_EQ(response.reconstruction().state(), v1::RECONSTRUCTION_STATE_CREATED);
  ASSERT_TRUE(Cancel("castle").ok());
  ASSERT_TRUE(reader->Read(&response));
  EXPECT_EQ(response.reconstruction().state(), v1::RECONSTRUCTION_STATE_CANCELLED);
  EXPECT_FALSE(reader->Read(&response));
  EXPECT_TRUE(reader->Finish().ok());
}

TEST_F(GrpcServerTest, AWorkersRequestIsChecked) {
  grpc::ClientContext context;
  v1::SynchronizeRequest request = Worker("w", 0);
  request.set_cores(0);
  const grpc::Status status = Synchronize(context, request);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_THAT(status.error_message(), HasSubstr("cores is 0"));
}

TEST_F(GrpcServerTest, ACallThatWaitsEndsWhenItsWorkerCallsAgainOrGivesUp) {
  grpc::ClientContext first;
  auto replaced = std::async(std::launch::async, [&] { return Synchronize(first, Worker("w", 60)); });
  ASSERT_TRUE(Eventually([&] { return workers_->ListWorkers().workers_size() == 1; }));
  grpc::ClientContext second;
  auto given_up = std::async(std::launch::async, [&] { return Synchronize(second, Worker("w", 60)); });
  EXPECT_EQ(replaced.get().error_code(), grpc::StatusCode::ABORTED);
  second.TryCancel();
  EXPECT_EQ(given_up.get().error_code(), grpc::StatusCode::CANCELLED);
}

TEST_F(GrpcServerTest, GoingDownAnswersWhoWaits) {
  ASSERT_TRUE(Create("castle").ok());
  grpc::ClientContext context;
  auto waiting = std::async(std::launch::async, [&] { return Synchronize(context, Worker("w", 60)); });
  ASSERT_TRUE(Eventually([&] { return workers_->ListWorkers().workers_size() == 1; }));
  grpc::ClientContext watching;
  v1::WatchReconstructionRequest request;
  request.set_id("castle");
  const auto reader = reconstructions_->WatchReconstruction(&watching, request);
  v1::WatchReconstructionResponse response;
  ASSERT_TRUE(reader->Read(&response));
  server_->Shutdown(absl::Seconds(20));
  EXPECT_TRUE(waiting.get().ok());
  EXPECT_FALSE(reader->Read(&response));
  EXPECT_EQ(reader->Finish().error_code(), grpc::StatusCode::UNAVAILABLE);
}

TEST_F(GrpcServerTest, APortThatIsTakenIsNamed) {
  const std::string address = absl::StrCat("127.0.0.1:", server_->port());
  const auto again = GrpcServer::Start({.listen = address}, *service_, *workers_, *blobs_, *gate_);
  EXPECT_TRUE(absl::IsUnavailable(again.status())) << again.status();
  EXPECT_THAT(std::string(again.status().message()), HasSubstr(address));
}

}  // namespace
}  // namespace meshwright
