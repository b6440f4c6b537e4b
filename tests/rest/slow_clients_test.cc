// SPDX-License-Identifier: Apache-2.0
// Clients of event streams that do not read: they are dropped, and what waits for them takes no memory of the server.

#include <fstream>
#include <thread>

#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include "common/base/check.h"
#include "common/base/clock.h"
#include "common/base/thread_pool.h"
#include "common/blob/filesystem_blob_store.h"
#include "coordinator/rest/rest_server.h"
#include "coordinator/store/sqlite_job_store.h"
#include "tests/end_to_end/program.h"

// Last: it brings the macro _res of resolv.h, a name that Eigen uses.
#include <httplib.h>

namespace meshwright {
namespace {

constexpr int kParts = 30'000;  // about 6 MB of events: more than the buffers of a connection take
constexpr int kStreams = 24;
constexpr int kIdleTimeoutSeconds = 2;
constexpr char kId[] = "long";

double ResidentMebibytes() {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);) {
    if (line.rfind("VmRSS:", 0) == 0) return std::stod(line.substr(6)) / 1024;
  }
  return 0;
}

// Asks for the events and reads nothing but how the answer begins.
class SilentClient {
 public:
  explicit SilentClient(int port) : socket_(::socket(AF_INET, SOCK_STREAM, 0)) {
    const int bytes = 4096;
    MW_CHECK(::setsockopt(socket_, SOL_SOCKET, SO_RCVBUF, &bytes, sizeof(bytes)) == 0);
    sockaddr_in address = {};
    address.sin_family = AF_INET;
    address.sin_port = htons(static_cast<uint16_t>(port));
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    MW_CHECK(::connect(socket_, reinterpret_cast<sockaddr*>(&address), sizeof(address)) == 0);
    const std::string request = std::string("GET /v1/reconstructions/") + kId + "/events HTTP/1.1\r\nHost: x\r\n\r\n";
    MW_CHECK(::send(socket_, request.data(), request.size(), 0) == static_cast<ssize_t>(request.size()));
    std::string begin(12, '\0');
    MW_CHECK(::recv(socket_, begin.data(), begin.size(), MSG_WAITALL) == static_cast<ssize_t>(begin.size()));
    MW_CHECK(begin == "HTTP/1.1 200");
  }
  SilentClient(const SilentClient&) = delete;
  SilentClient& operator=(const SilentClient&) = delete;
  ~SilentClient() { ::close(socket_); }

 private:
  const int socket_;
};

class SlowClientsTest : public testing::Test {
 protected:
  void SetUp() override {
    store_ = *OpenSqliteJobStore(folder_ / "state.sqlite");
    blobs_ = *FilesystemBlobStore::Open(folder_ / "blobs");
    Fill();
    gate_.emplace(GatekeeperOptions(), *store_, clock_);
    workers_ = std::make_unique<WorkerService>(LeaseOptions(), RetryOptions(), *store_);
    logic_ = *ReconstructionService::Open(
        {.data_folder = folder_ / "data"},
        {.store = store_.get(), .blobs = blobs_.get(), .clock = &clock_, .pool = &pool_}, *workers_);
    auto server = RestServer::Start(
        {.listen = "127.0.0.1:0",
         .folder = folder_ / "rest",
         .max_event_streams = kStreams,
         .idle_timeout_seconds = kIdleTimeoutSeconds},
        {.reconstructions = logic_.get(), .workers = workers_.get(), .blobs = blobs_.get(), .gate = &*gate_});
    ASSERT_TRUE(server.ok()) << server.status();
    server_ = *std::move(server);
  }

  // A reconstruction that is done, of many cameras.
  void Fill() {
    const absl::Time now = absl::FromUnixSeconds(1'000'000'000);
    const std::string digest(64, 'a');
    ASSERT_TRUE(store_->CreateReconstruction({.id = kId, .options_json = "{}", .scene_digest = digest}, now).ok());
    std::vector<CameraAssignment> assignments;
    std::vector<JobChange> claims, results;
    std::vector<Commit> commits;
    for (int s = 1; s <= kParts; ++s) {
      assignments.push_back({.sequence = s, .camera = s - 1});
      JobChange change = {.id = kId, .sequence = s, .epoch = 1, .worker = "w", .instance = "1", .expires_at = now};
      claims.push_back(change);
      change.kind = JobChange::Kind::kComplete;
      change.epoch = 2;
      change.filtered_digest = digest;
      change.report_json = "{}";
      results.push_back(change);
      commits.push_back(
          {.sequence = s, .camera = s - 1, .accepted_digest = digest, .filtered_patches = s, .accepted_patches = s});
    }
    const absl::StatusOr<int64_t> epoch = store_->AcquireConductorLease(kId, "test", now + absl::Hours(1), now);
    ASSERT_TRUE(epoch.ok()) << epoch.status();
    ASSERT_TRUE(store_->Advance(kId, {}, assignments, {}, now, *epoch).ok());
    ASSERT_TRUE(store_->ApplyChanges(claims, {}, now).ok());
    ASSERT_TRUE(store_->ApplyChanges(results, {}, now).ok());
    const absl::Status committed = store_->Advance(kId, commits, {}, {.cameras_committed = kParts}, now, *epoch);
    ASSERT_TRUE(committed.ok()) << committed;
    ASSERT_TRUE(store_->FinishReconstruction(kId, {.digest = digest}, now, *epoch).ok());
  }

  // The events' text; "" and the status in `status` when there is no stream.
  std::string ReadAll(int* status) const {
    httplib::Client client("127.0.0.1", server_->port());
    std::string text;
    const auto result =
        client.Get(std::string("/v1/reconstructions/") + kId + "/events", [&](const char* bytes, size_t count) {
          text.append(bytes, count);
          return true;
        });
    *status = result ? result->status : -1;
    return *status == 200 ? text : "";
  }

  const TemporaryFolder folder_;
  RealClock clock_;
  ThreadPool pool_{1};
  std::unique_ptr<JobStore> store_;
  std::optional<Gatekeeper> gate_;
  std::unique_ptr<BlobStore> blobs_;
  std::unique_ptr<WorkerService> workers_;
  std::unique_ptr<ReconstructionService> logic_;
  std::unique_ptr<RestServer> server_;
};

TEST_F(SlowClientsTest, WhoDoesNotReadIsDroppedAndTakesNoMemory) {
  // Who reads gets everything, in order.
  int status = 0;
  const std::string all = ReadAll(&status);
  ASSERT_EQ(status, 200);
  size_t at = 0;
  for (int s = 1; s <= kParts; ++s) {
    at = all.find("id: " + std::to_string(s) + "\nevent: part\n", at);
    ASSERT_NE(at, std::string::npos) << s;
  }
  EXPECT_NE(all.find("event: end", at), std::string::npos);

  const double before = ResidentMebibytes();
  std::vector<std::unique_ptr<SilentClient>> silent;
  for (int i = 0; i < kStreams; ++i) silent.push_back(std::make_unique<SilentClient>(server_->port()));
  // All places are taken until the idle timeout, and then free, though nobody went away.
  const Stopwatch stopwatch;
  ReadAll(&status);
  EXPECT_EQ(status, 503);
  std::string again;
  double most = 0;
  while (again.empty() && stopwatch.Seconds() < 5 * kIdleTimeoutSeconds) {
    most = std::max(most, ResidentMebibytes());
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    again = ReadAll(&status);
  }
  EXPECT_EQ(status, 200) << "nobody was dropped";
  EXPECT_TRUE(again == all);
  // What waits for them would be all.size() for each of them if it were queued.
  EXPECT_LT(most - before, 0.2 * kStreams * static_cast<double>(all.size()) / (1 << 20));
}

}  // namespace
}  // namespace meshwright
