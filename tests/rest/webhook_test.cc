// SPDX-License-Identifier: Apache-2.0
// Whoever runs the service is told when a reconstruction is over, however it ends.

#include <map>

#include <gmock/gmock.h>

#include "common/base/mutex.h"
#include "coordinator/webhook/webhook_sender.h"
#include "tests/rest/rest_cluster.h"

namespace meshwright {
namespace {

using testing::HasSubstr;

constexpr char kSecret[] = "a-secret-of-sixteen-or-more";

class WebhookTest : public RestCluster {
 protected:
  void SetUp() override {
    receiver_.Post("/hook", [this](const httplib::Request& request, httplib::Response&) {
      EXPECT_EQ(request.get_header_value("Meshwright-Signature"),
                SignWebhook(kSecret, request.get_header_value("Meshwright-Timestamp"), request.body));
      const MutexLock lock(mutex_);
      const Json body = Json::parse(request.body, nullptr, false);
      told_[body["id"]].push_back(body);
    });
    const int port = receiver_.bind_to_any_port("127.0.0.1");
    thread_ = std::thread([this] { receiver_.listen_after_bind(); });
    const std::string file = testing::TempDir() + "webhook_secret";
    MW_CHECK(WriteFileAtomically(file, kSecret).ok());
    settings_.webhook_url = absl::StrCat("http://127.0.0.1:", port, "/hook");
    settings_.webhook_secret_file = file;
    RestCluster::SetUp();
  }
  void TearDown() override {
    RestCluster::TearDown();
    receiver_.stop();
    thread_.join();
  }

  // What was told of it, once that is something.
  std::vector<Json> WaitFor(const std::string& id) {
    for (int i = 0; i < 3000; ++i) {
      {
        const MutexLock lock(mutex_);
        if (told_.count(id) > 0) return told_[id];
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    return {};
  }

  httplib::Server receiver_;
  std::thread thread_;
  Mutex mutex_;
  std::map<std::string, std::vector<Json>> told_ ABSL_GUARDED_BY(mutex_);
};

TEST_F(WebhookTest, TellsOfEachEndOnce) {
  ASSERT_EQ(PostJson("/v1/reconstructions", R"({"id":"waiting"})")->status, 200);
  ASSERT_EQ(http_->Post("/v1/reconstructions/waiting:cancel")->status, 200);
  ASSERT_EQ(PostJson("/v1/reconstructions", R"({"id":"empty"})")->status, 200);
  ASSERT_EQ(http_->Post("/v1/reconstructions/empty:start")->status, 200);
  ASSERT_EQ(PostJson("/v1/reconstructions", R"({"id":"done"})")->status, 200);
  UploadScene("done");
  StartWorker();
  ASSERT_EQ(http_->Post("/v1/reconstructions/done:start")->status, 200);

  ASSERT_EQ(WaitFor("waiting").size(), 1U);
  EXPECT_EQ(WaitFor("waiting")[0]["state"], "cancelled");
  ASSERT_EQ(WaitFor("empty").size(), 1U);
  EXPECT_EQ(WaitFor("empty")[0]["state"], "failed");
  EXPECT_THAT(WaitFor("empty")[0]["failure"].get<std::string>(), HasSubstr("no scene"));
  ASSERT_EQ(WaitFor("done").size(), 1U);
  const Json done = WaitFor("done")[0];
  EXPECT_EQ(done["state"], "done");
  EXPECT_EQ(done["mesh"]["sha256"], GetJson("/v1/reconstructions/done")["meshSha256"]);
  EXPECT_EQ(done["path"], "/v1/reconstructions/done");
}

}  // namespace
}  // namespace meshwright
