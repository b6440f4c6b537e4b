// SPDX-License-Identifier: Apache-2.0
// Which worker is which: nobody stops another's worker or brings its results by calling itself the same.

#include <cstdlib>
#include <utility>

#include <absl/time/clock.h>
#include <gmock/gmock.h>

#include "common/base/method_version.h"
#include "common/http_server/http_testing.h"
#include "tests/rest/access_cluster.h"

namespace meshwright {
namespace {

using testing::HasSubstr;

class WorkersJobTest : public AccessCluster {};

// A worker holds a job; others call themselves like it, wait in its place and bring its result.
TEST_F(WorkersJobTest, WhoCallsItselfLikeAWorkerNeitherStopsItNorBringsItsResults) {
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

// Certificates as an operator makes them.
TEST_F(WorkersJobTest, AWorkerWithACertificateWorks) {
  if (std::system("openssl version >/dev/null 2>&1") != 0) GTEST_SKIP() << "openssl is not installed";
  const auto openssl = [&](const std::string& arguments) {
    ASSERT_EQ(std::system(("cd '" + folder_ + "' && openssl " + arguments + " 2>openssl.log").c_str()), 0);
  };
  const std::string key = "-newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes -keyout ";
  openssl("req -x509 " + key + "ca.key -out ca.pem -days 2 -subj /CN=workers");
  openssl("req " + key + "node-1.key -out node-1.csr -subj /CN=node-1");
  openssl("x509 -req -in node-1.csr -CA ca.pem -CAkey ca.key -CAcreateserial -days 2 -out node-1.pem");
  Stop();
  settings_.worker_token_file.clear();
  settings_.tls_certificate_file = folder_ + "/server.pem";
  settings_.tls_key_file = folder_ + "/server.key";
  settings_.client_ca_file = folder_ + "/ca.pem";
  ASSERT_TRUE(WriteTestCertificate("localhost", settings_.tls_certificate_file, settings_.tls_key_file).ok());
  Start();
  auto made = WorkerProgram::Make({.coordinator = absl::StrCat("localhost:", coordinator_->port()),
                                   .id = "node-1",
                                   .ca_file = settings_.tls_certificate_file,
                                   .client_certificate_file = folder_ + "/node-1.pem",
                                   .client_key_file = folder_ + "/node-1.key"});
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

TEST_F(WorkersJobTest, SettingsOfCertificatesThatMeanNothingAreRefused) {
  CoordinatorSettings without_tls = settings_;
  without_tls.client_ca_file = folder_ + "/root";
  EXPECT_THAT(CoordinatorProgram::Check(without_tls).ToString(),
              HasSubstr("--client-ca-file: expected with --tls-cert"));
  WorkerSettings worker = {.client_certificate_file = folder_ + "/root"};
  EXPECT_THAT(WorkerProgram::Check(worker).ToString(), HasSubstr("--client-key"));
  worker.client_key_file = folder_ + "/join";
  EXPECT_THAT(WorkerProgram::Check(worker).ToString(), HasSubstr("--ca-file"));
}

}  // namespace
}  // namespace meshwright
