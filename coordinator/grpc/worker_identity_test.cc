// SPDX-License-Identifier: Apache-2.0
// Which worker is which: nobody stops another's worker, or works in its name, by calling itself the same.

#include <atomic>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include <absl/strings/str_cat.h>
#include <gmock/gmock.h>
#include <grpcpp/grpcpp.h>

#include "meshwright/v1/worker.grpc.pb.h"

#include "common/base/check.h"
#include "common/base/clock.h"
#include "common/base/digest.h"
#include "common/base/files.h"
#include "common/base/temporary_folder_testing.h"
#include "common/base/thread_pool.h"
#include "common/blob/filesystem_blob_store.h"
#include "coordinator/grpc/grpc_server.h"
#include "coordinator/store/sqlite_job_store.h"

namespace meshwright {
namespace {

using grpc::StatusCode;
using testing::HasSubstr;

constexpr char kOperatorKey[] = "the-operators-key-0123456789";
constexpr char kJoinKey[] = "the-workers-key-0123456789";

// Makes certificates as an operator does.
class Authority {
 public:
  explicit Authority(std::string folder) : folder_(std::move(folder)) {
    std::filesystem::create_directories(folder_);
    Run("req -x509 " + NewKey("ca") + " -out ca.pem -days 2 -subj '/CN=workers of the farm'");
  }
  // NAME.pem and NAME.key; `also`: another name that it vouches for.
  void Sign(const std::string& name, const std::string& also = "") const {
    Run("req " + NewKey(name) + " -out " + name + ".csr -subj '/CN=" + name + "'");
    MW_CHECK(WriteFileAtomically(path("extensions"), also.empty() ? "" : "subjectAltName=DNS:" + also).ok());
    Run("x509 -req -in " + name + ".csr -CA ca.pem -CAkey ca.key -CAcreateserial -days 2 -extfile extensions -out " +
        name + ".pem");
  }
  std::string path(const std::string& file) const { return folder_ + "/" + file; }

 private:
  static std::string NewKey(const std::string& name) {
    return "-newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes -keyout " + name + ".key";
  }
  void Run(const std::string& arguments) const {
    MW_CHECK(std::system(("cd '" + folder_ + "' && openssl " + arguments + " 2>openssl.log").c_str()) == 0);
  }
  const std::string folder_;
};

v1::SynchronizeRequest RequestOf(const std::string& id, const std::string& instance) {
  v1::SynchronizeRequest request;
  request.set_worker_id(id);
  request.set_instance(instance);
  request.set_cores(1);
  request.set_memory_bytes(1000);
  return request;
}

class WorkerIdentityTest : public testing::Test {
 protected:
  void SetUp() override { Start(); }
  void TearDown() override { Stop(); }

  void Start() {
    blobs_ = *FilesystemBlobStore::Open(folder_ / "blobs");
    store_ = *OpenSqliteJobStore(folder_ / "state.sqlite");
    workers_ = std::make_unique<WorkerService>(LeaseOptions(), RetryOptions(), *store_);
    service_ = *ReconstructionService::Open(
        {.data_folder = folder_ / "data"},
        {.store = store_.get(),
         .blobs = blobs_.get(),
         .clock = &clock_,
         .pool = &pool_,
         .jobs_changed = [this] { workers_->Wake(); },
         .parse_config =
             [](const std::string&) { return absl::StatusOr<ReconstructionConfig>(ReconstructionConfig()); }},
        *workers_);
    gate_ =
        std::make_unique<Gatekeeper>(GatekeeperOptions{.operator_key_digest = Sha256Hex(std::string(kOperatorKey)),
                                                       .worker_key_digest = Sha256Hex(std::string(kJoinKey)),
                                                       .count_refusal = [this](const absl::Status&) { ++refusals_; }},
                                     *store_, clock_);
    auto server = GrpcServer::Start(options_, *service_, *workers_, *blobs_, *gate_);
    ASSERT_TRUE(server.ok()) << server.status();
    server_ = *std::move(server);
  }
  void Stop() {
    server_.reset();
    service_.reset();
    workers_.reset();
    store_.reset();
  }

  std::string Key(const std::string& user) {
    const Caller root = *gate_->Identify(kOperatorKey, "here");
    return gate_->Create(root, {.user = user, .role = Role::kWorker})->text;
  }
  grpc::Status Synchronize(
      const std::string& key, const std::string& id, const std::string& instance,
      const std::shared_ptr<grpc::ChannelCredentials>& credentials = grpc::InsecureChannelCredentials()) const {
    const auto stub =
        v1::WorkerService::NewStub(grpc::CreateChannel(absl::StrCat("localhost:", server_->port()), credentials));
    grpc::ClientContext context;
    context.set_deadline(absl::ToChronoTime(SystemClock().Now() + absl::Seconds(20)));
    if (!key.empty()) context.AddMetadata("authorization", "Bearer " + key);
    v1::SynchronizeResponse response;
    return stub->Synchronize(&context, RequestOf(id, instance), &response);
  }

  const TemporaryFolder folder_;
  GrpcServerOptions options_ = {.listen = "127.0.0.1:0"};
  RealClock clock_;
  ThreadPool pool_{1};
  std::unique_ptr<BlobStore> blobs_;
  std::unique_ptr<JobStore> store_;
  std::unique_ptr<WorkerService> workers_;
  std::unique_ptr<ReconstructionService> service_;
  std::unique_ptr<Gatekeeper> gate_;
  std::atomic<int> refusals_ = 0;
  std::unique_ptr<GrpcServer> server_;
};

TEST_F(WorkerIdentityTest, AnIdIsOfTheKeyThatCameWithItFirst) {
  const std::string first = Key("rack-7");
  const std::string other = Key("rack-8");
  ASSERT_TRUE(Synchronize(first, "w", "1").ok());
  int refused = 0;
  for (const std::string& key : {other, std::string(kJoinKey)}) {
    for (const char* instance : {"1", "2"}) {
      const grpc::Status status = Synchronize(key, "w", instance);
      EXPECT_EQ(status.error_code(), StatusCode::PERMISSION_DENIED) << status.error_message();
      EXPECT_THAT(status.error_message(), HasSubstr("another --worker-id"));
      EXPECT_EQ(refusals_, ++refused);
    }
  }
  // Nor does another coordinator process, or a second key of the same user, change whose it is.
  Stop();
  Start();
  EXPECT_EQ(Synchronize(other, "w", "2").error_code(), StatusCode::PERMISSION_DENIED);
  EXPECT_TRUE(Synchronize(first, "w", "1").ok());
  EXPECT_TRUE(Synchronize(Key("rack-7"), "w", "3").ok());
  EXPECT_TRUE(Synchronize(other, "another", "1").ok());
  EXPECT_TRUE(Synchronize(kJoinKey, "third", "1").ok());
}

class WorkerCertificateTest : public WorkerIdentityTest {
 protected:
  void SetUp() override {
    if (std::system("openssl version >/dev/null 2>&1") != 0) GTEST_SKIP() << "openssl is not installed";
    farm_.emplace(folder_ / "farm");
    server_authority_.emplace(folder_ / "server");
    server_authority_->Sign("coordinator", "localhost");
    options_.tls_certificate_file = server_authority_->path("coordinator.pem");
    options_.tls_key_file = server_authority_->path("coordinator.key");
    options_.client_ca_file = farm_->path("ca.pem");
    Start();
  }
  // `certificate`: "": none is shown.
  grpc::Status Work(const Authority& authority, const std::string& certificate, const std::string& id,
                    const std::string& key = "") const {
    grpc::SslCredentialsOptions credentials = {.pem_root_certs = *ReadFile(server_authority_->path("ca.pem"))};
    if (!certificate.empty()) {
      credentials.pem_cert_chain = *ReadFile(authority.path(certificate + ".pem"));
      credentials.pem_private_key = *ReadFile(authority.path(certificate + ".key"));
    }
    return Synchronize(key, id, "1", grpc::SslCredentials(credentials));
  }
  std::optional<Authority> farm_;
  std::optional<Authority> server_authority_;
};

TEST_F(WorkerCertificateTest, ACertificateStandsForAKeyAndSaysTheName) {
  farm_->Sign("node-1", "node-1.farm.example");
  farm_->Sign("node-2");
  for (const char* id : {"node-1", "node-1+b", "node-1.farm.example", "node-1.farm.example+2"}) {
    const grpc::Status worked = Work(*farm_, "node-1", id);
    EXPECT_TRUE(worked.ok()) << id << ": " << worked.error_message();
  }
  for (const char* id : {"node-2", "node", "node-10", "node-1.evil.example", "+", "w"}) {
    const grpc::Status refused = Work(*farm_, "node-1", id);
    EXPECT_EQ(refused.error_code(), StatusCode::PERMISSION_DENIED) << id << ": " << refused.error_message();
  }
  EXPECT_EQ(refusals_, 6);
  EXPECT_EQ(Work(*farm_, "node-2", "node-1").error_code(), StatusCode::PERMISSION_DENIED);
  EXPECT_TRUE(Work(*farm_, "node-2", "node-2").ok());
  // Who has none shows a key; a key that is wrong is not made good by a certificate.
  EXPECT_EQ(Work(*farm_, "", "node-1").error_code(), StatusCode::UNAUTHENTICATED);
  EXPECT_EQ(Work(*farm_, "node-1", "node-1", "wrong").error_code(), StatusCode::UNAUTHENTICATED);
  EXPECT_TRUE(Work(*farm_, "", "by-key", kJoinKey).ok());
}

TEST_F(WorkerCertificateTest, ACertificatesNameIsNobodyElses) {
  farm_->Sign("node-1");
  const std::string key = Key("rack-7");
  // Somebody with a key has taken the name meanwhile.
  EXPECT_TRUE(Work(*farm_, "", "node-1", key).ok());
  EXPECT_TRUE(Work(*farm_, "node-1", "node-1").ok());
  EXPECT_EQ(Work(*farm_, "", "node-1", key).error_code(), StatusCode::PERMISSION_DENIED);
}

TEST_F(WorkerCertificateTest, CertificatesOfOthersEndTheConnection) {
  const Authority others(folder_ / "others");
  others.Sign("node-1");
  EXPECT_EQ(Work(others, "node-1", "node-1").error_code(), StatusCode::UNAVAILABLE);
  EXPECT_EQ(Work(others, "ca", "node-1").error_code(), StatusCode::UNAVAILABLE);
}

}  // namespace
}  // namespace meshwright
