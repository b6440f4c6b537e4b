// SPDX-License-Identifier: Apache-2.0
// NodeODM's protocol asks for the same keys as /v1: its clients show them as ?token=.

#include <memory>
#include <string>

#include <absl/strings/str_cat.h>
#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include "common/base/check.h"
#include "common/base/clock.h"
#include "common/base/digest.h"
#include "common/base/temporary_folder_testing.h"
#include "common/base/thread_pool.h"
#include "common/blob/filesystem_blob_store.h"
#include "common/http_server/http_testing.h"
#include "coordinator/nodeodm/nodeodm_server.h"
#include "coordinator/store/sqlite_job_store.h"

// Last: it brings the macro _res of resolv.h, a name that Eigen uses.
#include <httplib.h>

namespace meshwright {
namespace {

using testing::HasSubstr;

constexpr char kRoot[] = "the-operators-key-0123456789";
constexpr char kJoin[] = "the-workers-key-0123456789";
constexpr char kNoTask[] = "00000000-0000-4000-8000-000000000000";
constexpr char kOptions[] = R"({"options": [
  {"name": "max-image-size", "type": "integer", "unit": "px", "default": 0, "minimum": 0.0, "maximum": 100000.0,
   "documentation": "longest side", "tradeOff": "", "group": "x"}]})";
constexpr char kForm[] = "multipart/form-data; boundary=x";

class NodeOdmAccessTest : public testing::Test {
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
             [](const std::string& options) {
               return absl::StatusOr<ReconstructionConfig>(ReconstructionConfig{.options_json = options});
             },
         .list_photographs = [](const std::string&) { return std::vector<PhotographFile>(); }},
        *workers_);
    gate_ = std::make_unique<Gatekeeper>(GatekeeperOptions{.operator_key_digest = Sha256Hex(std::string(kRoot)),
                                                           .worker_key_digest = Sha256Hex(std::string(kJoin)),
                                                           .quotas = quotas_},
                                         *store_, clock_);
    auto server = NodeOdmServer::Start({.listen = "127.0.0.1:0", .folder = folder_ / "nodeodm"},
                                       {.reconstructions = service_.get(),
                                        .workers = workers_.get(),
                                        .blobs = blobs_.get(),
                                        .gate = gate_.get(),
                                        .clock = &clock_,
                                        .options_json = kOptions});
    ASSERT_TRUE(server.ok()) << server.status();
    server_ = *std::move(server);
    node_ = std::make_unique<httplib::Client>("127.0.0.1", server_->port());
  }
  void Stop() {
    node_.reset();
    server_.reset();
    service_.reset();
    workers_.reset();
    store_.reset();
  }

  std::string Key(const std::string& user, Role role) {
    return gate_->Create(*gate_->Identify(kRoot, "here"), {.user = user, .role = role})->text;
  }
  void Revoke(const std::string& key) {
    ASSERT_TRUE(gate_->Revoke(*gate_->Identify(kRoot, "here"), key.substr(4, 16)).ok());
  }
  std::string GetTask(const std::string& path, const std::string& key) const {
    const auto answer = node_->Get(path + "?token=" + key);
    EXPECT_EQ(answer->status, 200) << path << answer->body;
    return answer->body;
  }
  httplib::Result Post(const std::string& path, const std::string& key, const httplib::Params& fields = {}) const {
    return node_->Post(path + "?token=" + key, fields);
  }
  // The UUID, or "" and what was said in `said`.
  std::string Begin(const std::string& key, std::string* said = nullptr) const {
    const auto begun = node_->Post("/task/new/init?token=" + key, "", "application/x-www-form-urlencoded");
    if (said != nullptr) *said = begun->body;
    return nlohmann::json::parse(begun->body).value("uuid", "");
  }
  std::string Upload(const std::string& uuid, const std::string& key, const std::string& bytes = "bytes") const {
    const std::string form =
        "--x\r\nContent-Disposition: form-data; name=\"images\"; filename=\"cameras.txt\"\r\n\r\n" + bytes +
        "\r\n--x--";
    return node_->Post("/task/new/upload/" + uuid + "?token=" + key, form, kForm)->body;
  }

  const TemporaryFolder folder_;
  Quotas quotas_ = {.requests_per_second = 10'000};
  RealClock clock_;
  ThreadPool pool_{1};
  std::unique_ptr<BlobStore> blobs_;
  std::unique_ptr<JobStore> store_;
  std::unique_ptr<WorkerService> workers_;
  std::unique_ptr<ReconstructionService> service_;
  std::unique_ptr<Gatekeeper> gate_;
  std::unique_ptr<NodeOdmServer> server_;
  std::unique_ptr<httplib::Client> node_;
};

TEST_F(NodeOdmAccessTest, WhoShowsNoValidKeyGetsNothing) {
  const std::string revoked = Key("alice", Role::kSubmitter);
  const std::string uuid = Begin(revoked);
  ASSERT_NE(uuid, "");
  Revoke(revoked);
  for (const std::string& key : {std::string(), std::string("x"), std::string(kRoot) + "x", revoked}) {
    for (const std::string& path :
         {std::string("/info"), std::string("/options"), std::string("/task/list"), "/task/" + uuid + "/info",
          "/task/" + uuid + "/output", "/task/" + uuid + "/download/all.zip"}) {
      EXPECT_THAT(GetTask(path, key), HasSubstr("Invalid authentication token")) << path;
    }
    EXPECT_THAT(Upload(uuid, key), HasSubstr("Invalid authentication token"));
    for (const std::string& path : {std::string("/task/new"), std::string("/task/new/init"), "/task/new/commit/" + uuid,
                                    std::string("/task/cancel"), std::string("/task/remove")}) {
      EXPECT_THAT(Post(path, key, {{"uuid", uuid}})->body, HasSubstr("Invalid authentication token")) << path;
    }
  }
}

TEST_F(NodeOdmAccessTest, TenantsTasksDoNotExistForEachOther) {
  const std::string alice = Key("alice", Role::kSubmitter);
  const std::string bob = Key("bob", Role::kSubmitter);
  const std::string uuid = Begin(alice);
  ASSERT_NE(uuid, "");
  EXPECT_THAT(Upload(uuid, bob), HasSubstr("Invalid uuid (not found)"));
  EXPECT_THAT(Post("/task/new/commit/" + uuid, bob)->body, HasSubstr("Invalid uuid (not found)"));
  EXPECT_THAT(Upload(uuid, alice), HasSubstr("\"success\":true"));
  ASSERT_THAT(Post("/task/new/commit/" + uuid, alice)->body, HasSubstr(uuid));
  const auto as_of_none = [&](std::string text) {
    for (size_t at = text.find(kNoTask); at != std::string::npos; at = text.find(kNoTask)) text.replace(at, 36, uuid);
    return text;
  };
  for (const char* rest : {"/info", "/output", "/download/all.zip"}) {
    EXPECT_EQ(GetTask("/task/" + uuid + rest, bob), as_of_none(GetTask(std::string("/task/") + kNoTask + rest, bob)));
  }
  for (const char* path : {"/task/cancel", "/task/restart", "/task/remove"}) {
    EXPECT_EQ(Post(path, bob, {{"uuid", uuid}})->body, as_of_none(Post(path, bob, {{"uuid", kNoTask}})->body));
  }
  EXPECT_EQ(GetTask("/task/list", bob), "[]");
  EXPECT_THAT(GetTask("/task/list", alice), HasSubstr(uuid));
  EXPECT_THAT(GetTask("/task/list", kRoot), HasSubstr(uuid));
  EXPECT_THAT(GetTask("/task/" + uuid + "/info", alice), HasSubstr("\"uuid\":\"" + uuid));
  // It is the same reconstruction under /v1, and the same after a restart of the coordinator.
  EXPECT_EQ(store_->GetReconstruction(uuid)->owner, "alice");
  Stop();
  Start();
  EXPECT_EQ(GetTask("/task/list", bob), "[]");
  EXPECT_THAT(Post("/task/remove", alice, {{"uuid", uuid}})->body, HasSubstr("\"success\":true"));
}

TEST_F(NodeOdmAccessTest, RolesMayNoMoreThanTheirName) {
  const std::string alice = Key("alice", Role::kSubmitter);
  const std::string uuid = Begin(alice);
  ASSERT_THAT(Post("/task/new/commit/" + uuid, alice)->body, HasSubstr(uuid));
  const std::string viewer = Key("alice", Role::kViewer);
  EXPECT_THAT(GetTask("/task/" + uuid + "/info", viewer), HasSubstr("\"uuid\":\"" + uuid));
  for (const std::string& key : {viewer, Key("rack-7", Role::kWorker)}) {
    EXPECT_EQ(Post("/task/new/init", key)->status, 403);
    EXPECT_EQ(Post("/task/new", key)->status, 403);
    for (const char* path : {"/task/cancel", "/task/restart", "/task/remove"}) {
      EXPECT_EQ(Post(path, key, {{"uuid", uuid}})->status, 403);
    }
  }
  EXPECT_EQ(node_->Get(std::string("/task/list?token=") + kJoin)->status, 403);
  EXPECT_THAT(GetTask("/task/" + uuid + "/info", alice), HasSubstr("\"uuid\":\"" + uuid));
}

TEST_F(NodeOdmAccessTest, QuotasHold) {
  Stop();
  quotas_ = {.reconstructions = 2, .scene_bytes = 1'000'000'000, .requests_per_second = 20};
  Start();
  const std::string alice = Key("alice", Role::kSubmitter);
  const std::string uuid = Begin(alice);
  ASSERT_NE(uuid, "");
  ASSERT_NE(Begin(alice), "");
  std::string said;
  EXPECT_EQ(Begin(alice, &said), "");
  EXPECT_THAT(said, HasSubstr("allowed are 2"));
  EXPECT_THAT(said, HasSubstr("noRetry"));
  // A form that says how long it is is refused before it is sent.
  const RawClient large(server_->port());
  large.Send("POST /task/new/upload/" + uuid + "?token=" + alice +
             " HTTP/1.1\r\nHost: x\r\nContent-Length: 1000000001\r\nContent-Type: " + kForm + "\r\n\r\n--x");
  EXPECT_THAT(large.Read(10, "}"), HasSubstr("allowed are 1000000000"));
  EXPECT_THAT(Upload(uuid, alice), HasSubstr("\"success\":true"));
  int refused = 0;
  for (int i = 0; i < 200; ++i) {
    const auto got = node_->Get("/info?token=" + alice);
    if (got->status == 429) refused += got->has_header("Retry-After") ? 1 : 0;
  }
  EXPECT_GT(refused, 20);
  EXPECT_THAT(GetTask("/info", kRoot), HasSubstr("\"engine\":\"meshwright\""));
}

// Forms can be sent from any page without asking, to wherever its reader's browser gets.
TEST_F(NodeOdmAccessTest, PagesOfOthersSendNothing) {
  const std::string path = std::string("/task/new/init?token=") + kRoot;
  const auto begin = [&](const httplib::Headers& headers) {
    return node_->Post(path, headers, "", "application/x-www-form-urlencoded")->status;
  };
  EXPECT_EQ(begin({}), 200);
  EXPECT_EQ(begin({{"Origin", "http://evil.example"}}), 403);
  EXPECT_EQ(begin({{"Origin", "null"}}), 403);
  EXPECT_EQ(begin({{"Host", "evil.example:3000"}}), 403);
}

}  // namespace
}  // namespace meshwright
