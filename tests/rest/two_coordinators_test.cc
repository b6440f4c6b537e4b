// SPDX-License-Identifier: Apache-2.0
// Two coordinators on one PostgreSQL and one folder of blobs: what one conducts, the other one shows all the same.

#include "coordinator/store/postgres_testing.h"
#include "tests/rest/rest_cluster.h"

namespace meshwright {
namespace {

class TwoCoordinatorsTest : public RestCluster {
 protected:
  void SetUp() override {
    const absl::StatusOr<std::string> server = SharedTestPostgres();
    if (!server.ok()) GTEST_SKIP() << server.status().message();
    schema_ = std::make_unique<PostgresSchema>(*server);
    settings_.store = schema_->url();
    RestCluster::SetUp();
    settings_.blobs = folder_ + "/blobs";
    Stop();
    Start();
    CoordinatorSettings other = settings_;
    other.data_folder = folder_ + "/other";
    auto started = CoordinatorProgram::Start(other);
    ASSERT_TRUE(started.ok()) << started.status();
    other_ = *std::move(started);
    other_http_ = std::make_unique<httplib::Client>("127.0.0.1", other_->rest_port());
    other_http_->set_read_timeout(60);
  }
  void TearDown() override {
    if (schema_ == nullptr) return;
    other_http_.reset();
    other_.reset();
    RestCluster::TearDown();
    schema_.reset();
  }

  // What both say, expected to be the same bytes.
  std::string FromBoth(const std::string& path) {
    const auto here = http_->Get(path);
    const auto there = other_http_->Get(path);
    EXPECT_TRUE(here && here->status == 200) << path << (here ? here->body : "");
    EXPECT_TRUE(there && there->status == 200) << path << (there ? there->body : "");
    if (!here || !there) return "";
    EXPECT_TRUE(here->body == there->body) << path;
    EXPECT_EQ(here->get_header_value("ETag"), there->get_header_value("ETag")) << path;
    return there->body;
  }

  std::unique_ptr<PostgresSchema> schema_;
  std::unique_ptr<CoordinatorProgram> other_;
  std::unique_ptr<httplib::Client> other_http_;
};

TEST_F(TwoCoordinatorsTest, WhatOneConductsTheOtherShows) {
  const std::string base = "/v1/reconstructions/shared";
  ASSERT_EQ(PostJson("/v1/reconstructions", R"({"id":"shared"})")->status, 200);
  // Whole files may go to either of them.
  bool here = true;
  for (const auto& [path, content] : SceneFiles()) {
    if (here) {
      ASSERT_EQ(PutPart("shared", path, content, 0, content.size())->status, 200);
    } else {
      std::swap(http_, other_http_);
      ASSERT_EQ(PutPart("shared", path, content, 0, content.size())->status, 200);
      std::swap(http_, other_http_);
    }
    here = !here;
  }
  const Json files = Json::parse(FromBoth(base + "/files"))["files"];
  ASSERT_EQ(files.size(), SceneFiles().size());
  for (const Json& file : files) EXPECT_TRUE(file["complete"].get<bool>()) << file;

  // This one takes it up at once, long before the other one looks.
  ASSERT_EQ(http_->Post(base + ":start")->status, 200);
  StartWorker();
  std::string events;
  const auto streamed = other_http_->Get(base + "/events", [&](const char* bytes, size_t count) {
    events.append(bytes, count);
    return true;
  });
  ASSERT_TRUE(streamed) << "the stream did not end well";
  EXPECT_NE(events.find("RECONSTRUCTION_STATE_DONE"), std::string::npos);
  EXPECT_NE(events.find("event: end"), std::string::npos);

  const Json parts = Json::parse(FromBoth(base + "/parts"))["parts"];
  ASSERT_FALSE(parts.empty());
  for (const Json& part : parts) {
    EXPECT_NE(events.find(part["sha256"].get<std::string>()), std::string::npos) << part;
    const std::string path = absl::StrCat(base, "/parts/", part["sequence"].get<int>());
    FromBoth(path);
    FromBoth(path + "/preview?max_faces=100");
  }
  const Json reconstruction = Json::parse(FromBoth(base));
  EXPECT_EQ(Sha256Hex(FromBoth(base + "/mesh")), reconstruction["meshSha256"]);
  EXPECT_EQ(FromBoth(base + "/mesh?partial=true").size(), std::stoull(reconstruction["meshBytes"].get<std::string>()));
  for (const char* path : {"/mesh.glb", "/cameras", "/cameras/0/photo?width=40", "/incidence", "/attempts", "/log"}) {
    FromBoth(base + path);
  }

  // The worker knows one of them; both know it, a second or two later, and either can drain it.
  Json workers;
  for (int i = 0; i < 200 && workers.empty(); ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    workers = Json::parse(other_http_->Get("/v1/workers")->body)["workers"];
  }
  ASSERT_EQ(workers.size(), 1U);
  EXPECT_EQ(workers[0]["id"], "w");
  ASSERT_EQ(other_http_->Post("/v1/workers/w:drain")->status, 204);
  while (!GetJson("/v1/workers")["workers"][0]["draining"].get<bool>()) {
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
  EXPECT_EQ(other_http_->Delete(base)->status, 204);
  EXPECT_EQ(http_->Get(base + "/mesh")->status, 404);
  EXPECT_EQ(other_http_->Get(base + "/mesh")->status, 404);
}

}  // namespace
}  // namespace meshwright
