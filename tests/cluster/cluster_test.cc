// SPDX-License-Identifier: Apache-2.0
// A coordinator and its workers in one process, on a free port, over real connections.

#include <cstdlib>
#include <filesystem>
#include <thread>

#include <absl/strings/str_cat.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "clients/cpp/service_client.h"
#include "pipeline/local/local_reconstruction.h"
#include "tools/synthetic/synthetic_scene.h"

#include "common/base/check.h"
#include "common/base/digest.h"
#include "common/base/files.h"
#include "common/blob/s3_testing.h"
#include "common/scene/formats/import.h"
#include "coordinator/main/coordinator_program.h"
#include "coordinator/store/postgres_testing.h"
#include "worker/main/worker_program.h"

namespace meshwright {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

// A small facade, made once.
const std::string& SharedScene() {
  static const std::string folder = [] {
    std::string pattern = testing::TempDir() + "cluster_scene_XXXXXX";
    MW_CHECK(mkdtemp(pattern.data()) != nullptr);
    ThreadPool pool(2);
    const auto scene =
        MakeSyntheticScene({.kind = SyntheticKind::kFacade, .cameras = 6, .width = 240, .height = 180}, pool);
    MW_CHECK(scene.ok());
    MW_CHECK(WriteSyntheticScene(*scene, pattern + "/facade", pool).ok());
    return pattern;
  }();
  return folder;
}

struct RemoveSharedScene : testing::Environment {
  void TearDown() override { fs::remove_all(SharedScene()); }
};
const testing::Environment* const kRemoveSharedScene = testing::AddGlobalTestEnvironment(new RemoveSharedScene);

class ClusterTest : public testing::Test {
 protected:
  void SetUp() override {
    MakeFolder();
    StartCoordinator();
  }
  void MakeFolder() {
    std::string pattern = testing::TempDir() + "cluster_XXXXXX";
    MW_CHECK(mkdtemp(pattern.data()) != nullptr);
    folder_ = pattern;
  }
  void TearDown() override {
    StopWorkers();
    client_.reset();
    coordinator_.reset();
    fs::remove_all(folder_);
  }

  void StartCoordinator() {
    auto started = CoordinatorProgram::Start({.listen = "127.0.0.1:0",
                                              .data_folder = folder_ + "/data",
                                              .store = store_,
                                              .blobs = blobs_,
                                              .scene_roots = {SharedScene()},
                                              .lease_seconds = 3});
    ASSERT_TRUE(started.ok()) << started.status();
    coordinator_ = *std::move(started);
    address_ = absl::StrCat("127.0.0.1:", coordinator_->port());
    client_ = ServiceClient::Connect(address_);
  }
  void StartWorker(const std::string& id, bool shared_blobs) {
    auto worker = WorkerProgram::Make(
        {.coordinator = address_, .id = id, .blobs = shared_blobs ? SharedBlobs() : "", .cores = 1});
    ASSERT_TRUE(worker.ok()) << worker.status();
    workers_.push_back(*std::move(worker));
    threads_.emplace_back([program = workers_.back().get()] { program->Run(); });
  }
  std::string SharedBlobs() const { return blobs_.empty() ? folder_ + "/data/blobs" : blobs_; }
  void StopWorkers() {
    for (const auto& worker : workers_) worker->Drain();
    for (std::thread& thread : threads_) thread.join();
    workers_.clear();
    threads_.clear();
  }

  v1::CreateReconstructionRequest ByReference(const std::string& id) const {
    v1::CreateReconstructionRequest request;
    request.set_id(id);
    request.set_scene_reference("file:facade");
    return request;
  }
  void CreateAndStart(const v1::CreateReconstructionRequest& request) {
    const auto created = client_->Create(request);
    ASSERT_TRUE(created.ok()) << created.status();
    const auto started = client_->Start(request.id());
    ASSERT_TRUE(started.ok()) << started.status();
  }
  v1::Reconstruction WaitFor(const std::string& id) {
    v1::Reconstruction last;
    const absl::Status status = client_->Watch(id, [&](const v1::Reconstruction& now) { last = now; });
    EXPECT_TRUE(status.ok()) << status;
    return last;
  }
  std::string FetchMesh(const std::string& id) {
    const std::string path = absl::StrCat(folder_, "/", id, ".ply");
    const absl::Status status = client_->Fetch(id, path);
    EXPECT_TRUE(status.ok()) << status;
    return status.ok() ? *ReadFile(path) : "";
  }

  // What the laptop makes of it.
  static const std::string& LocalMesh() {
    static const std::string mesh = [] {
      const Scene scene = *ImportScene(SharedScene() + "/facade");
      const std::string path = SharedScene() + "/local.ply";
      const ReconstructionOptions options;
      const auto report = ReconstructLocally(
          scene, options,
          {.output_path = path, .report_path = path + ".json", .work_folder = path + ".work", .threads = 2},
          [&](const CameraJobInput& input, ThreadPool& pool) { return RunCameraJob(input, options.job, pool); },
          [](const LocalProgress&) {});
      EXPECT_TRUE(report.ok()) << report.status();
      return *ReadFile(path);
    }();
    return mesh;
  }

  std::string folder_;
  std::string store_;  // "": the default
  std::string blobs_;
  std::string address_;
  std::unique_ptr<CoordinatorProgram> coordinator_;
  std::unique_ptr<ServiceClient> client_;
  std::vector<std::unique_ptr<WorkerProgram>> workers_;
  std::vector<std::thread> threads_;
};

TEST_F(ClusterTest, TwoWorkersMakeWhatTheLaptopMakes) {
  StartWorker("shared", true);
  StartWorker("streaming", false);
  CreateAndStart(ByReference("facade"));
  const v1::Reconstruction done = WaitFor("facade");
  EXPECT_EQ(done.state(), v1::RECONSTRUCTION_STATE_DONE) << done.failure();
  EXPECT_EQ(done.progress().cameras_committed(), 6);
  EXPECT_EQ(done.progress().cameras_skipped(), 0);
  EXPECT_GT(done.progress().faces(), 100);
  EXPECT_TRUE(FetchMesh("facade") == LocalMesh());
  EXPECT_EQ(client_->ListWorkers()->workers_size(), 2);
}

TEST_F(ClusterTest, AnUploadedSceneIsTheSame) {
  v1::CreateReconstructionRequest request;
  request.set_id("uploaded");
  ASSERT_TRUE(client_->Create(request).ok());
  const fs::path scene = SharedScene() + "/facade";
  for (const auto& entry : fs::recursive_directory_iterator(scene)) {
    if (!entry.is_regular_file() || entry.path().extension() == ".ply") continue;
    const absl::Status sent =
        client_->Upload("uploaded", entry.path().lexically_relative(scene).string(), entry.path().string());
    ASSERT_TRUE(sent.ok()) << sent;
  }
  StartWorker("w", true);
  ASSERT_TRUE(client_->Start("uploaded").ok());
  const v1::Reconstruction done = WaitFor("uploaded");
  EXPECT_EQ(done.state(), v1::RECONSTRUCTION_STATE_DONE) << done.failure();
  EXPECT_TRUE(FetchMesh("uploaded") == LocalMesh());
  EXPECT_TRUE(
      absl::IsFailedPrecondition(client_->Upload("uploaded", "late.txt", (scene / "model/cameras.txt").string())));
}

TEST_F(ClusterTest, ACoordinatorThatIsStartedAnewGoesOn) {
  CreateAndStart(ByReference("facade"));
  StartWorker("first", false);
  while (client_->Get("facade")->progress().cameras_committed() < 2) {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  StopWorkers();
  client_.reset();
  coordinator_.reset();
  StartCoordinator();
  StartWorker("second", false);
  const v1::Reconstruction done = WaitFor("facade");
  EXPECT_EQ(done.state(), v1::RECONSTRUCTION_STATE_DONE) << done.failure();
  EXPECT_TRUE(FetchMesh("facade") == LocalMesh());
}

TEST_F(ClusterTest, PostgresHoldsTheStateAsWell) {
  const absl::StatusOr<std::string> server = SharedTestPostgres();
  if (!server.ok()) GTEST_SKIP() << server.status().message();
  const PostgresSchema schema(*server);
  store_ = schema.url();
  coordinator_.reset();
  StartCoordinator();
  StartWorker("w", true);
  CreateAndStart(ByReference("facade"));
  const v1::Reconstruction done = WaitFor("facade");
  EXPECT_EQ(done.state(), v1::RECONSTRUCTION_STATE_DONE) << done.failure();
  EXPECT_TRUE(FetchMesh("facade") == LocalMesh());
  StopWorkers();
  coordinator_.reset();  // before its schema goes
}

// Two coordinators on one PostgreSQL and one folder of blobs, a worker at each. In the middle the one that conducts
// loses its lease to somebody who is never heard of; whoever of the two looks first goes on when that has run out.
TEST_F(ClusterTest, CoordinatorsShareAReconstructionAndTakeItOver) {
  const absl::StatusOr<std::string> server = SharedTestPostgres();
  if (!server.ok()) GTEST_SKIP() << server.status().message();
  const PostgresSchema schema(*server);
  store_ = schema.url();
  blobs_ = folder_ + "/shared_blobs";
  coordinator_.reset();
  StartCoordinator();
  const auto second = CoordinatorProgram::Start({.listen = "127.0.0.1:0",
                                                 .data_folder = folder_ + "/second",
                                                 .store = store_,
                                                 .blobs = blobs_,
                                                 .scene_roots = {SharedScene()},
                                                 .lease_seconds = 3});
  ASSERT_TRUE(second.ok()) << second.status();
  CreateAndStart(ByReference("facade"));
  StartWorker("first", false);
  address_ = absl::StrCat("127.0.0.1:", (*second)->port());
  StartWorker("second", true);
  const std::unique_ptr<ServiceClient> other = ServiceClient::Connect(address_);
  while (other->Get("facade")->progress().cameras_committed() < 2) {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  const std::string owner =
      RunSql(schema.url(), "SELECT owner FROM conductor_leases WHERE reconstruction_id = 'facade'");
  EXPECT_THAT(owner, HasSubstr(folder_));
  RunSql(schema.url(), "UPDATE conductor_leases SET owner = 'nobody', epoch = epoch + 1");
  client_ = ServiceClient::Connect(address_);
  const v1::Reconstruction done = WaitFor("facade");
  EXPECT_EQ(done.state(), v1::RECONSTRUCTION_STATE_DONE) << done.failure();
  EXPECT_TRUE(FetchMesh("facade") == LocalMesh());
  // The mesh is everywhere.
  client_ = ServiceClient::Connect(absl::StrCat("127.0.0.1:", coordinator_->port()));
  EXPECT_TRUE(FetchMesh("facade") == LocalMesh());
  EXPECT_EQ(client_->ListWorkers()->workers_size(), 2);
  StopWorkers();
  coordinator_.reset();
}

TEST_F(ClusterTest, S3HoldsTheBlobsAsWell) {
  const auto server = S3Server::Start();
  if (!server.ok()) GTEST_SKIP() << server.status().message();
  const S3Options options = (*server)->NewOptions();
  ::setenv("AWS_ENDPOINT_URL", options.endpoint.c_str(), 1);
  ::setenv("AWS_REGION", options.region.c_str(), 1);
  ::setenv("AWS_ACCESS_KEY_ID", options.access_key_id.c_str(), 1);
  ::setenv("AWS_SECRET_ACCESS_KEY", options.secret_access_key.c_str(), 1);
  blobs_ = absl::StrCat("s3://", options.bucket, "/", options.prefix);
  coordinator_.reset();
  StartCoordinator();
  StartWorker("direct", true);
  StartWorker("streaming", false);
  CreateAndStart(ByReference("facade"));
  const v1::Reconstruction done = WaitFor("facade");
  EXPECT_EQ(done.state(), v1::RECONSTRUCTION_STATE_DONE) << done.failure();
  EXPECT_TRUE(FetchMesh("facade") == LocalMesh());
  StopWorkers();
  coordinator_.reset();  // before its server goes
}

TEST_F(ClusterTest, CreatingIsIdempotentAndIdsAreNotUsedTwice) {
  ASSERT_TRUE(client_->Create(ByReference("one")).ok());
  EXPECT_TRUE(client_->Create(ByReference("one")).ok());
  v1::CreateReconstructionRequest other = ByReference("one");
  other.set_options_json(R"({"window": 1})");
  EXPECT_TRUE(absl::IsAlreadyExists(client_->Create(other).status()));
  ASSERT_TRUE(client_->Create(ByReference("two")).ok());
  EXPECT_EQ(client_->List("")->reconstructions_size(), 2);
  EXPECT_EQ(client_->List("one")->reconstructions(0).id(), "two");
  EXPECT_TRUE(client_->Delete("one").ok());
  EXPECT_TRUE(absl::IsNotFound(client_->Get("one").status()));
  EXPECT_TRUE(absl::IsAlreadyExists(client_->Create(ByReference("one")).status()));
}

TEST_F(ClusterTest, CancellingEndsIt) {
  CreateAndStart(ByReference("facade"));
  ASSERT_TRUE(client_->Cancel("facade").ok());
  EXPECT_EQ(WaitFor("facade").state(), v1::RECONSTRUCTION_STATE_CANCELLED);
  EXPECT_TRUE(absl::IsFailedPrecondition(client_->Start("facade").status()));
  EXPECT_TRUE(absl::IsFailedPrecondition(client_->Fetch("facade", folder_ + "/x.ply")));
  EXPECT_FALSE(fs::exists(folder_ + "/x.ply"));
}

TEST_F(ClusterTest, AnEmptySceneFailsWithAWord) {
  v1::CreateReconstructionRequest request;
  request.set_id("empty");
  CreateAndStart(request);
  const v1::Reconstruction failed = WaitFor("empty");
  EXPECT_EQ(failed.state(), v1::RECONSTRUCTION_STATE_FAILED);
  EXPECT_FALSE(failed.failure().empty());
}

TEST_F(ClusterTest, BadRequestsNameTheField) {
  const auto refused = [&](const v1::CreateReconstructionRequest& request) {
    const auto created = client_->Create(request);
    EXPECT_FALSE(created.ok());
    return std::string(created.status().message());
  };
  EXPECT_THAT(refused(ByReference("")), HasSubstr("id"));
  EXPECT_THAT(refused(ByReference("../x")), HasSubstr("id"));
  EXPECT_THAT(refused(ByReference("Upper")), HasSubstr("id"));
  for (const char* reference : {"file:../x", "file:/etc", "file:nowhere", "http://x", "file:", "file:facade/../.."}) {
    v1::CreateReconstructionRequest request = ByReference("x");
    request.set_scene_reference(reference);
    EXPECT_THAT(refused(request), HasSubstr("scene_reference")) << reference;
  }
  for (const char* options : {"[]", "{", R"({"windw": 1})", R"({"window": "4"})", R"({"window": 0})",
                              R"({"window": 1e99})", R"({"window": 99999999999})", R"({"version": "7"})"}) {
    v1::CreateReconstructionRequest request = ByReference("x");
    request.set_options_json(options);
    EXPECT_THAT(refused(request), HasSubstr("options_json")) << options;
  }
  v1::CreateReconstructionRequest request = ByReference("x");
  request.set_weight(-1);
  EXPECT_THAT(refused(request), HasSubstr("weight"));
  request.clear_weight();
  request.clear_scene_reference();
  ASSERT_TRUE(client_->Create(request).ok());
  for (const char* path : {"../x", "/x", "", "a//b", "a/./b", "a/.."}) {
    const absl::Status status = client_->Upload("x", path, SharedScene() + "/facade/model/cameras.txt");
    EXPECT_TRUE(absl::IsInvalidArgument(status)) << status;
    EXPECT_THAT(std::string(status.message()), HasSubstr("path"));
  }
  EXPECT_TRUE(absl::IsNotFound(client_->Start("nobody").status()));
}

}  // namespace
}  // namespace meshwright
