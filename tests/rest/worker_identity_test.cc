// Which worker is which: nobody stops another's worker or brings its results by calling itself the same.

#include <cstdlib>
#include <filesystem>
#include <optional>
#include <utility>

#include <absl/time/clock.h>
#include <gmock/gmock.h>

#include "common/base/method_version.h"
#include "common/http_server/http_testing.h"
#include "tests/rest/access_cluster.h"

namespace meshwright {
namespace {

using testing::HasSubstr;

class WorkerIdentityTest : public AccessCluster {};

TEST_F(WorkerIdentityTest, AnIdIsOfTheKeyThatCameWithItFirst) {
  const std::string first = Key("rack-7", v1::ROLE_WORKER);
  const std::string other = Key("rack-8", v1::ROLE_WORKER);
  ASSERT_TRUE(Synchronize(first, WorkerRequest("w", "1")).ok());
  for (const std::string& key : {other, std::string(kJoin)}) {
    for (const char* instance : {"1", "2"}) {
      const absl::Status refused = Synchronize(key, WorkerRequest("w", instance));
      EXPECT_TRUE(absl::IsPermissionDenied(refused)) << refused;
      EXPECT_THAT(std::string(refused.message()), HasSubstr("another --worker-id"));
    }
  }
  // Nor does another coordinator process, or a second key of the same user, change whose it is.
  Stop();
  Start();
  EXPECT_TRUE(absl::IsPermissionDenied(Synchronize(other, WorkerRequest("w", "2"))));
  EXPECT_TRUE(Synchronize(first, WorkerRequest("w", "1")).ok());
  EXPECT_TRUE(Synchronize(Key("rack-7", v1::ROLE_WORKER), WorkerRequest("w", "3")).ok());
  EXPECT_TRUE(Synchronize(other, WorkerRequest("another", "1")).ok());
}

// A worker holds a job; others call themselves like it, wait in its place and bring its result.
TEST_F(WorkerIdentityTest, WhoCallsItselfLikeAWorkerNeitherStopsItNorBringsItsResults) {
  const auto authorized = Bearer(kRoot);
  ASSERT_EQ(Create("castle", kRoot), 200);
  for (const auto& [path, content] : SceneFiles()) {
    const std::string query = absl::StrCat("/v1/reconstructions/castle/files/", path, "?size=", content.size(),
                                           "&sha256=", Sha256Hex(content));
    ASSERT_EQ(http_->Put(query, authorized, content, "application/octet-stream")->status, 200);
  }
  ASSERT_EQ(http_->Post("/v1/reconstructions/castle:start", authorized, "", "text/plain")->status, 200);
  const std::string key = Key("rack-7", v1::ROLE_WORKER);
  const std::string other = Key("rack-8", v1::ROLE_WORKER);
  const auto worker = GrpcCoordinator::Connect(absl::StrCat("127.0.0.1:", coordinator_->port()), {.key = key});
  v1::SynchronizeRequest request = WorkerRequest();
  request.set_memory_bytes(int64_t{4} << 30);
  request.set_method_version(kMethodVersion);
  request.set_wait_timeout_seconds(1);
  absl::StatusOr<v1::SynchronizeResponse> answer = worker->Synchronize(request);
  for (int i = 0; i < 60 && answer.ok() && answer->jobs_size() == 0; ++i) answer = worker->Synchronize(request);
  ASSERT_TRUE(answer.ok()) << answer.status();
  ASSERT_EQ(answer->jobs_size(), 1);
  const v1::JobKey job = answer->jobs(0).key();

  v1::SynchronizeRequest forged = request;
  v1::HeldJob& held = *forged.add_held();
  *held.mutable_key() = job;
  held.mutable_finished()->set_filtered_digest(std::string(64, 'a'));
  held.mutable_finished()->set_report_json("{}");
  EXPECT_TRUE(absl::IsPermissionDenied(Synchronize(other, forged)));
  forged.set_instance("2");
  EXPECT_TRUE(absl::IsPermissionDenied(Synchronize(other, forged)));
  // Under a name of its own it is heard, and what it says of the other's job is not.
  forged.set_worker_id("another");
  forged.set_cores(1);
  forged.set_wait_timeout_seconds(0);
  EXPECT_TRUE(Synchronize(other, forged).ok());

  *request.add_held()->mutable_key() = job;
  request.mutable_held(0)->mutable_running();
  request.set_wait_timeout_seconds(0);
  answer = worker->Synchronize(request);
  ASSERT_TRUE(answer.ok()) << answer.status();
  ASSERT_EQ(answer->jobs_size(), 1);
  EXPECT_EQ(answer->jobs(0).key().sequence(), job.sequence());
  EXPECT_EQ(answer->jobs(0).key().epoch(), job.epoch());
}

// Makes certificates as an operator does.
class Authority {
 public:
  explicit Authority(std::string folder) : folder_(std::move(folder)) {
    std::filesystem::create_directories(folder_);
    Run("req -x509 " + NewKey("ca") + " -out ca.pem -days 2 -subj '/CN=workers of the farm'");
  }
  // With NAME.pem and NAME.key; `also`: another name that it vouches for.
  void Sign(const std::string& name, const std::string& also = "") const {
    Run("req " + NewKey(name) + " -out " + name + ".csr -subj '/CN=" + name + "'");
    MW_CHECK(WriteFileAtomically(folder_ + "/extensions", also.empty() ? "" : "subjectAltName=DNS:" + also).ok());
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

class WorkerCertificateTest : public WorkerIdentityTest {
 protected:
  void SetUp() override {
    WorkerIdentityTest::SetUp();
    if (std::system("openssl version >/dev/null 2>&1") != 0) GTEST_SKIP() << "openssl is not installed";
    farm_.emplace(folder_ + "/farm");
    Stop();
    settings_.worker_token_file.clear();
    settings_.tls_certificate_file = folder_ + "/server.pem";
    settings_.tls_key_file = folder_ + "/server.key";
    settings_.client_ca_file = farm_->path("ca.pem");
    ASSERT_TRUE(WriteTestCertificate("localhost", settings_.tls_certificate_file, settings_.tls_key_file).ok());
    Start();
  }
  // "": without a certificate.
  absl::Status Work(const Authority& authority, const std::string& certificate, const std::string& id,
                    const std::string& key = "") const {
    CoordinatorCredentials credentials = {.key = key, .ca_certificates = *ReadFile(settings_.tls_certificate_file)};
    if (!certificate.empty()) {
      credentials.certificate = *ReadFile(authority.path(certificate + ".pem"));
      credentials.private_key = *ReadFile(authority.path(certificate + ".key"));
    }
    return GrpcCoordinator::Connect(absl::StrCat("localhost:", coordinator_->port()), credentials)
        ->Synchronize(WorkerRequest(id))
        .status();
  }
  std::optional<Authority> farm_;
};

TEST_F(WorkerCertificateTest, ACertificateStandsForAKeyAndSaysTheName) {
  farm_->Sign("node-1", "node-1.farm.example");
  farm_->Sign("node-2");
  for (const char* id : {"node-1", "node-1+b", "node-1.farm.example", "node-1.farm.example+2"}) {
    const absl::Status worked = Work(*farm_, "node-1", id);
    EXPECT_TRUE(worked.ok()) << id << ": " << worked;
  }
  for (const char* id : {"node-2", "node", "node-10", "node-1.evil.example", "+", "w"}) {
    EXPECT_TRUE(absl::IsPermissionDenied(Work(*farm_, "node-1", id))) << id;
  }
  EXPECT_TRUE(absl::IsPermissionDenied(Work(*farm_, "node-2", "node-1")));
  EXPECT_TRUE(Work(*farm_, "node-2", "node-2").ok());
  // Who has none shows a key; a key that is wrong is not made good by a certificate.
  EXPECT_TRUE(absl::IsUnauthenticated(Work(*farm_, "", "node-1")));
  EXPECT_TRUE(absl::IsUnauthenticated(Work(*farm_, "node-1", "node-1", "wrong")));
}

TEST_F(WorkerCertificateTest, ACertificatesNameIsNobodyElses) {
  farm_->Sign("node-1");
  const auto root =
      ServiceClient::Connect(absl::StrCat("localhost:", coordinator_->port()),
                             {.key = kRoot, .ca_certificates = *ReadFile(settings_.tls_certificate_file)});
  v1::CreateKeyRequest wanted;
  wanted.set_user("rack-7");
  wanted.set_role(v1::ROLE_WORKER);
  const auto key = root->CreateKey(wanted);
  ASSERT_TRUE(key.ok()) << key.status();
  // Somebody with a key has taken the name meanwhile.
  EXPECT_TRUE(Work(*farm_, "", "node-1", key->text()).ok());
  EXPECT_TRUE(Work(*farm_, "node-1", "node-1").ok());
  EXPECT_TRUE(absl::IsPermissionDenied(Work(*farm_, "", "node-1", key->text())));
}

TEST_F(WorkerCertificateTest, CertificatesOfOthersEndTheConnection) {
  const Authority others(folder_ + "/others");
  others.Sign("node-1");
  EXPECT_TRUE(absl::IsUnavailable(Work(others, "node-1", "node-1")));
  ASSERT_TRUE(WriteTestCertificate("node-1", others.path("self.pem"), others.path("self.key")).ok());
  EXPECT_TRUE(absl::IsUnavailable(Work(others, "self", "node-1")));
}

TEST_F(WorkerCertificateTest, AWorkerWithOneWorks) {
  farm_->Sign("node-1");
  auto made = WorkerProgram::Make({.coordinator = absl::StrCat("localhost:", coordinator_->port()),
                                   .id = "node-1",
                                   .ca_file = settings_.tls_certificate_file,
                                   .client_certificate_file = farm_->path("node-1.pem"),
                                   .client_key_file = farm_->path("node-1.key")});
  ASSERT_TRUE(made.ok()) << made.status();
  worker_ = *std::move(made);
  worker_thread_ = std::thread([this] { worker_->Run(); });
  std::string workers;
  for (int i = 0; i < 100 && workers.find("node-1") == std::string::npos; ++i) {
    absl::SleepFor(absl::Milliseconds(100));
    workers = http_->Get("/v1/workers", Bearer(kRoot))->body;
  }
  EXPECT_THAT(workers, HasSubstr("\"id\":\"node-1\""));
}

TEST_F(WorkerCertificateTest, SettingsThatMeanNothingAreRefused) {
  CoordinatorSettings without_tls = settings_;
  without_tls.tls_certificate_file.clear();
  without_tls.tls_key_file.clear();
  EXPECT_THAT(CoordinatorProgram::Check(without_tls).ToString(),
              HasSubstr("--client-ca-file: expected with --tls-cert"));
  WorkerSettings worker = {.client_certificate_file = farm_->path("ca.pem")};
  EXPECT_THAT(WorkerProgram::Check(worker).ToString(), HasSubstr("--client-key"));
  worker.client_key_file = farm_->path("ca.key");
  EXPECT_THAT(WorkerProgram::Check(worker).ToString(), HasSubstr("--ca-file"));
}

}  // namespace
}  // namespace meshwright
// SPDX-License-Identifier: Apache-2.0
