// SPDX-License-Identifier: Apache-2.0
// Who may what, over real connections: the same keys over HTTP and gRPC, with and without TLS. The rows of the threat
// table in docs/security.md name these tests.

#include <absl/time/clock.h>
#include <gmock/gmock.h>
#include <grpcpp/grpcpp.h>

#include "meshwright/v1/reconstruction.grpc.pb.h"

#include "common/http_server/http_testing.h"
#include "tests/rest/access_cluster.h"

namespace meshwright {
namespace {

using testing::HasSubstr;

class AccessOverTheNetworkTest : public AccessCluster {};

TEST_F(AccessOverTheNetworkTest, WhoShowsNoValidKeyGetsNothing) {
  const std::string alice = Key("alice", v1::ROLE_SUBMITTER);
  ASSERT_EQ(Create("castle", alice), 200);
  const std::string expired = Key("alice", v1::ROLE_SUBMITTER, 1);
  absl::SleepFor(absl::Milliseconds(1100));
  const std::string revoked = Key("alice", v1::ROLE_SUBMITTER);
  ASSERT_TRUE(Grpc(kRoot)->RevokeKey(revoked.substr(4, 16)).ok());
  std::string wrong = alice;
  wrong.back() = wrong.back() == '0' ? '1' : '0';
  std::string said;
  for (const std::string& key : {std::string("x"), std::string(kRoot) + "x", wrong, expired, revoked}) {
    for (const char* path : {"/v1/reconstructions", "/v1/reconstructions/castle", "/v1/workers", "/v1/options"}) {
      const auto refused = http_->Get(path, Bearer(key));
      EXPECT_EQ(refused->status, 401) << path;
      EXPECT_EQ(refused->get_header_value("WWW-Authenticate"), "Bearer");
      if (said.empty()) said = refused->body;
      EXPECT_EQ(refused->body, said);
    }
    EXPECT_EQ(Create("mine", key), 401);
    EXPECT_TRUE(absl::IsUnauthenticated(Grpc(key)->Get("castle").status()));
    EXPECT_TRUE(absl::IsUnauthenticated(Grpc(key)->ListWorkers().status()));
    EXPECT_TRUE(absl::IsUnauthenticated(Grpc(key)->ListKeys().status()));
    EXPECT_TRUE(absl::IsUnauthenticated(Grpc(key)->Upload("castle", "a", folder_ + "/root")));
    EXPECT_TRUE(absl::IsUnauthenticated(Synchronize(key)));
  }
  EXPECT_EQ(http_->Get("/v1/reconstructions")->status, 401);
  EXPECT_TRUE(absl::IsUnauthenticated(Grpc("")->Get("castle").status()));
  EXPECT_EQ(http_->Get("/healthz")->status, 200);
}

// Each refusal is counted by what it was, and neither answers, metrics nor the log have anything of a key.
TEST_F(AccessOverTheNetworkTest, RefusalsAreCountedAndTellNothing) {
  Stop();
  settings_.metrics_listen = "127.0.0.1:0";
  testing::internal::CaptureStderr();
  Start();
  const std::string alice = Key("alice", v1::ROLE_SUBMITTER);
  const std::string viewer = Key("vera", v1::ROLE_VIEWER);
  const std::string wrong = alice.substr(0, alice.size() - 4) + "0000";
  const auto metrics = [&] { return httplib::Client("127.0.0.1", coordinator_->metrics_port()).Get("/metrics")->body; };
  const auto refused = [&](const std::string& code) {
    const std::string line = "meshwright_calls_refused_total{code=\"" + code + "\"} ";
    const std::string text = metrics();
    const size_t at = text.find(line);
    return at == std::string::npos ? 0 : std::stoi(text.substr(at + line.size()));
  };
  ASSERT_EQ(Create("castle", alice), 200);
  EXPECT_EQ(refused("UNAUTHENTICATED"), 0);
  std::string said;
  for (const std::string& key : {std::string(), std::string("guess-of-a-key"), wrong}) {
    said += http_->Get("/v1/reconstructions", Bearer(key))->body;
    said += Grpc(key)->Get("castle").status().ToString();
  }
  EXPECT_EQ(refused("UNAUTHENTICATED"), 6);
  said += http_->Delete("/v1/reconstructions/castle", Bearer(viewer))->body;
  said += Grpc(viewer)->ListWorkers().status().ToString();
  EXPECT_EQ(refused("PERMISSION_DENIED"), 2);
  said += http_->Get("/v1/reconstructions/castle", Bearer(viewer))->body;
  EXPECT_EQ(refused("NOT_FOUND"), 1);
  said += metrics();
  Stop();
  const std::string log = testing::internal::GetCapturedStderr();
  EXPECT_THAT(log, HasSubstr("UNAUTHENTICATED"));
  EXPECT_THAT(log, HasSubstr("DELETE /v1/reconstructions/{id}"));
  for (const std::string& text : {log, said}) {
    for (const std::string& key : {alice, viewer, wrong, std::string(kRoot), std::string(kJoin)}) {
      EXPECT_THAT(text, testing::Not(HasSubstr(key.substr(key.size() - 12)))) << key;
    }
    EXPECT_THAT(text, testing::Not(HasSubstr("guess-of-a-key")));
  }
}

TEST_F(AccessOverTheNetworkTest, TenantsDoNotExistForEachOther) {
  const std::string alice = Key("alice", v1::ROLE_SUBMITTER);
  const std::string bob = Key("bob", v1::ROLE_SUBMITTER);
  ASSERT_EQ(Create("castle", alice), 200);
  const std::string castle = "/v1/reconstructions/castle";
  const std::string none = "/v1/reconstructions/castlf";
  for (const char* rest : {"", "/events", "/files", "/files/a", "/cameras", "/incidence", "/attempts", "/log", "/parts",
                           "/parts/1", "/parts/1/preview", "/mesh", "/mesh.glb", "/cameras/0/photo"}) {
    const auto other = http_->Get(castle + rest, Bearer(bob));
    EXPECT_EQ(other->status, 404) << rest;
    std::string body = http_->Get(none + rest, Bearer(bob))->body;
    body.replace(body.find("castlf"), 6, "castle");
    EXPECT_EQ(other->body, body) << rest;
  }
  EXPECT_EQ(http_->Post(castle + ":start", Bearer(bob), "", "text/plain")->status, 404);
  EXPECT_EQ(http_->Post(castle + ":cancel", Bearer(bob), "", "text/plain")->status, 404);
  EXPECT_EQ(http_->Delete(castle, Bearer(bob))->status, 404);
  EXPECT_EQ(http_->Put(castle + "/files/a?size=1&sha256=" + Sha256Hex(std::string("x")), Bearer(bob), "x", "text/plain")
                ->status,
            404);
  EXPECT_EQ(Create("castle", bob), 409);
  const auto grpc = Grpc(bob);
  EXPECT_TRUE(absl::IsNotFound(grpc->Get("castle").status()));
  EXPECT_TRUE(absl::IsNotFound(grpc->Start("castle").status()));
  EXPECT_TRUE(absl::IsNotFound(grpc->Cancel("castle").status()));
  EXPECT_TRUE(absl::IsNotFound(grpc->Delete("castle")));
  EXPECT_TRUE(absl::IsNotFound(grpc->ListParts("castle").status()));
  EXPECT_TRUE(absl::IsNotFound(grpc->Watch("castle", [](const v1::Reconstruction&) {})));
  EXPECT_TRUE(absl::IsNotFound(grpc->Upload("castle", "a", folder_ + "/root")));
  EXPECT_EQ(grpc->List("")->reconstructions_size(), 0);
  EXPECT_EQ(Grpc(alice)->List("")->reconstructions_size(), 1);
  EXPECT_EQ(Grpc(kRoot)->List("")->reconstructions_size(), 1);
  EXPECT_EQ(Get(castle, alice), 200);
  EXPECT_EQ(Get(castle, kRoot), 200);
}

TEST_F(AccessOverTheNetworkTest, RolesMayNoMoreThanTheirName) {
  const std::string alice = Key("alice", v1::ROLE_SUBMITTER);
  const std::string viewer = Key("alice", v1::ROLE_VIEWER);
  ASSERT_EQ(Create("castle", alice), 200);
  const std::string castle = "/v1/reconstructions/castle";
  EXPECT_EQ(Get(castle, viewer), 200);
  EXPECT_EQ(Create("tower", viewer), 403);
  EXPECT_EQ(http_->Delete(castle, Bearer(viewer))->status, 403);
  EXPECT_TRUE(absl::IsPermissionDenied(Grpc(viewer)->Delete("castle")));
  for (const std::string& key : {viewer, alice}) {
    EXPECT_EQ(Get("/v1/workers", key), 403);
    EXPECT_EQ(http_->Post("/v1/workers/w:drain", Bearer(key), "", "text/plain")->status, 403);
    EXPECT_TRUE(absl::IsPermissionDenied(Grpc(key)->ListWorkers().status()));
    EXPECT_TRUE(absl::IsPermissionDenied(Synchronize(key)));
    v1::CreateKeyRequest request;
    request.set_user("eve");
    request.set_role(v1::ROLE_OPERATOR);
    EXPECT_TRUE(absl::IsPermissionDenied(Grpc(key)->CreateKey(request).status()));
  }
  // A worker works, and an operator does everything else.
  EXPECT_TRUE(Synchronize(kJoin).ok());
  EXPECT_TRUE(Synchronize(Key("rack-7", v1::ROLE_WORKER)).ok());
  const auto worker = GrpcCoordinator::Connect(absl::StrCat("127.0.0.1:", coordinator_->port()), {.key = kJoin});
  const auto digest = worker->Put("bytes");
  ASSERT_TRUE(digest.ok()) << digest.status();
  EXPECT_EQ(*worker->Get(*digest), "bytes");
  EXPECT_EQ(Get(castle, kJoin), 403);
  EXPECT_TRUE(absl::IsPermissionDenied(Grpc(kJoin)->Get("castle").status()));
  EXPECT_TRUE(absl::IsPermissionDenied(Grpc(kJoin)->List("").status()));
  EXPECT_TRUE(absl::IsPermissionDenied(Synchronize(kRoot)));
  EXPECT_EQ(Get("/v1/workers", kRoot), 200);
}

TEST_F(AccessOverTheNetworkTest, AShareLinkReadsOneReconstruction) {
  const std::string alice = Key("alice", v1::ROLE_SUBMITTER);
  ASSERT_EQ(Create("castle", alice), 200);
  ASSERT_EQ(Create("tower", alice), 200);
  v1::CreateKeyRequest request;
  request.set_reconstruction_id("castle");
  request.set_role(v1::ROLE_VIEWER);
  request.mutable_lifetime()->set_seconds(3600);
  const auto made = Grpc(alice)->CreateKey(request);
  ASSERT_TRUE(made.ok()) << made.status();
  const std::string link = made->text();
  EXPECT_EQ(Get("/v1/reconstructions/castle", link), 200);
  EXPECT_EQ(Get("/v1/reconstructions/castle/files", link), 200);
  EXPECT_EQ(Get("/v1/formats", link), 200);
  EXPECT_EQ(Get("/v1/reconstructions/tower", link), 404);
  EXPECT_EQ(Get("/v1/reconstructions", link), 403);
  EXPECT_EQ(http_->Delete("/v1/reconstructions/castle", Bearer(link))->status, 403);
  EXPECT_TRUE(Grpc(link)->Get("castle").ok());
  EXPECT_TRUE(absl::IsNotFound(Grpc(link)->Get("tower").status()));
  ASSERT_TRUE(Grpc(alice)->RevokeKey(made->key().id()).ok());
  EXPECT_EQ(Get("/v1/reconstructions/castle", link), 401);
  request.set_reconstruction_id("tower");
  EXPECT_TRUE(absl::IsNotFound(Grpc(Key("bob", v1::ROLE_SUBMITTER))->CreateKey(request).status()));
}

TEST_F(AccessOverTheNetworkTest, ABrowsersSessionIsOfNoUseToOtherPages) {
  const std::string alice = Key("alice", v1::ROLE_SUBMITTER);
  EXPECT_EQ(http_->Post("/v1/session", Bearer("x"), "", "text/plain")->status, 401);
  const auto begun = http_->Post("/v1/session", Bearer(alice), "", "text/plain");
  ASSERT_EQ(begun->status, 204);
  const std::string cookie = begun->get_header_value("Set-Cookie");
  EXPECT_THAT(cookie, HasSubstr("; HttpOnly; SameSite=Strict"));
  const httplib::Headers session = {{"Cookie", cookie.substr(0, cookie.find(';'))}};
  EXPECT_EQ(http_->Get("/v1/reconstructions", session)->status, 200);
  const auto create = [&](httplib::Headers headers) {
    return http_->Post("/v1/reconstructions", headers, R"({"id":"castle"})", "application/json")->status;
  };
  EXPECT_EQ(create(session), 403);
  httplib::Headers from_the_page = session;
  from_the_page.emplace("X-Meshwright-Csrf", "1");
  httplib::Headers foreign = from_the_page;
  foreign.emplace("Origin", "http://evil.example");
  EXPECT_EQ(create(foreign), 403);
  EXPECT_EQ(create(from_the_page), 200);
  const auto ended = http_->Delete("/v1/session", from_the_page);
  EXPECT_THAT(ended->get_header_value("Set-Cookie"), HasSubstr("Max-Age=0"));
}

TEST_F(AccessOverTheNetworkTest, ANameThatMeansThisMachineIsNoWayIn) {
  for (const char* host :
       {"evil.example", "evil.example:80", "127.evil.example", "localhost.evil.example", "EVIL.example."}) {
    EXPECT_EQ(http_->Get("/v1/options", {{"Authorization", absl::StrCat("Bearer ", kRoot)}, {"Host", host}})->status,
              403)
        << host;
    EXPECT_EQ(http_->Get("/", {{"Host", host}})->status, 403) << host;
  }
  for (const char* host : {"localhost", "LOCALHOST:7421", "127.0.0.1", "[::1]:1", "a.localhost", "behind"}) {
    EXPECT_EQ(http_->Get("/v1/options", {{"Authorization", absl::StrCat("Bearer ", kRoot)}, {"Host", host}})->status,
              200)
        << host;
  }
}

TEST_F(AccessOverTheNetworkTest, QuotasHold) {
  Stop();
  settings_.user_reconstructions = 2;
  settings_.user_gigabytes = 1;
  settings_.user_requests_per_second = 20;
  Start();
  const std::string alice = Key("alice", v1::ROLE_SUBMITTER);
  ASSERT_EQ(Create("castle", alice), 200);
  ASSERT_EQ(Create("tower", alice), 200);
  const auto third = http_->Post("/v1/reconstructions", Bearer(alice), R"({"id":"mill"})", "application/json");
  EXPECT_EQ(third->status, 429);
  EXPECT_TRUE(third->has_header("Retry-After"));
  EXPECT_EQ(Create("castle", alice), 200);  // repeating is harmless
  const std::string sha256 = Sha256Hex(std::string("x"));
  const auto put = http_->Put("/v1/reconstructions/castle/files/a?size=1000000001&sha256=" + sha256, Bearer(alice), "x",
                              "text/plain");
  EXPECT_EQ(put->status, 507) << put->body;
  int refused = 0;
  for (int i = 0; i < 200; ++i) {
    const auto got = http_->Get("/v1/reconstructions/castle", Bearer(alice));
    if (got->status == 429) refused += got->has_header("Retry-After") ? 1 : 0;
  }
  EXPECT_GT(refused, 20);
  EXPECT_EQ(Get("/v1/reconstructions/castle", kRoot), 200);
}

TEST_F(AccessOverTheNetworkTest, WatchesThatNobodyReadsEnd) {
  const std::string alice = Key("alice", v1::ROLE_SUBMITTER);
  ASSERT_EQ(Create("castle", alice), 200);
  const auto stub = v1::ReconstructionService::NewStub(
      grpc::CreateChannel(absl::StrCat("127.0.0.1:", coordinator_->port()), grpc::InsecureChannelCredentials()));
  // More than one user may have at a time, one after the other.
  int refused = 0;
  for (int i = 0; i < 100; ++i) {
    grpc::ClientContext context;
    context.AddMetadata("authorization", "Bearer " + alice);
    v1::WatchReconstructionRequest request;
    request.set_id("castle");
    const auto reader = stub->WatchReconstruction(&context, request);
    v1::WatchReconstructionResponse response;
    if (!reader->Read(&response)) {
      EXPECT_EQ(reader->Finish().error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
      ++refused;
      absl::SleepFor(absl::Milliseconds(100));
      continue;
    }
    context.TryCancel();
    reader->Finish();
  }
  EXPECT_LT(refused, 20);
}

TEST_F(AccessOverTheNetworkTest, TlsKeepsKeysFromTheNetwork) {
  Stop();
  settings_.tls_certificate_file = folder_ + "/certificate.pem";
  settings_.tls_key_file = folder_ + "/certificate.key";
  ASSERT_TRUE(WriteTestCertificate("localhost", settings_.tls_certificate_file, settings_.tls_key_file).ok());
  Start();
  const std::string address = absl::StrCat("localhost:", coordinator_->port());
  const auto ask = [&] {
    return ServiceClient::Connect(address, {.key = kRoot, .ca_certificates = *ReadFile(settings_.tls_certificate_file)})
        ->List("")
        .status();
  };
  EXPECT_TRUE(ask().ok()) << ask();
  EXPECT_TRUE(absl::IsUnavailable(ServiceClient::Connect(address, {.key = kRoot})->List("").status()));
  // Another certificate is nobody that was vouched for.
  ASSERT_TRUE(WriteTestCertificate("localhost", folder_ + "/other.pem", folder_ + "/other.key").ok());
  EXPECT_TRUE(absl::IsUnavailable(
      ServiceClient::Connect(address, {.key = kRoot, .ca_certificates = *ReadFile(folder_ + "/other.pem")})
          ->List("")
          .status()));
  // Files that change are read again.
  std::filesystem::rename(folder_ + "/other.key", settings_.tls_key_file);
  std::filesystem::rename(folder_ + "/other.pem", settings_.tls_certificate_file);
  absl::Status changed = ask();
  for (int i = 0; i < 30 && !changed.ok(); ++i) {
    absl::SleepFor(absl::Seconds(1));
    changed = ask();
  }
  EXPECT_TRUE(changed.ok()) << changed;
}

TEST_F(AccessOverTheNetworkTest, WhatOthersReachAsksForKeys) {
  CoordinatorSettings open = settings_;
  open.api_token_file.clear();
  open.worker_token_file.clear();
  EXPECT_TRUE(CoordinatorProgram::Check(open).ok());
  for (const char* address : {"0.0.0.0:0", "[::]:0", "10.0.0.1:0", "example.org:0", "127.example.org:0"}) {
    CoordinatorSettings exposed = open;
    exposed.listen = address;
    EXPECT_THAT(CoordinatorProgram::Check(exposed).ToString(), HasSubstr("--listen is")) << address;
    exposed.insecure = true;
    EXPECT_TRUE(CoordinatorProgram::Check(exposed).ok());
    exposed = open;
    exposed.rest_listen = address;
    EXPECT_THAT(CoordinatorProgram::Check(exposed).ToString(), HasSubstr("--rest-listen is")) << address;
    exposed.api_token_file = settings_.api_token_file;
    EXPECT_TRUE(CoordinatorProgram::Check(exposed).ok());
  }
}

}  // namespace
}  // namespace meshwright
