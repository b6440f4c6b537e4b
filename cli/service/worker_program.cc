#include "cli/service/worker_program.h"

#include <algorithm>
#include <cstdio>
#include <utility>

#include <absl/strings/str_cat.h>
#include <absl/time/clock.h>
#include <unistd.h>

#include "cli/service/open_stores.h"
#include "cli/service/parse_method.h"
#include "common/base/status_macros.h"
#include "worker/agent/agent.h"
#include "worker/agent/grpc_coordinator.h"

namespace meshwright {
namespace {

std::string DefaultId() {
  char host[64] = "worker";
  if (::gethostname(host, sizeof(host) - 1) != 0) host[0] = '\0';
  return absl::StrCat(host, "-", ::getpid());
}

int64_t MemoryMib(const WorkerSettings& settings) {
  return settings.memory_mib > 0 ? settings.memory_mib : std::max<int64_t>(1024, int64_t{512} * settings.cores);
}

class RealWorkerProgram final : public WorkerProgram {
 public:
  RealWorkerProgram(const WorkerSettings& settings, std::unique_ptr<GrpcCoordinator> coordinator,
                    std::unique_ptr<BlobStore> shared_blobs)
      : id_(settings.id.empty() ? DefaultId() : settings.id),
        coordinator_(std::move(coordinator)),
        shared_blobs_(std::move(shared_blobs)),
        agent_({.worker_id = id_,
                .version = MW_VERSION,
                .cores = settings.cores,
                .memory_bytes = MemoryMib(settings) << 20,
                .drain = absl::Seconds(settings.drain_seconds)},
               *coordinator_, shared_blobs_ != nullptr ? *shared_blobs_ : *coordinator_, ParseWorkerMethod,
               RunCameraJob, [this](const std::string& line) { Log(line); }) {}

  void Run() override { agent_.Run(); }
  void Drain() override {
    Log("draining");
    agent_.Drain();
  }

 private:
  void Log(const std::string& line) const {
    const std::string time = absl::FormatTime("%Y-%m-%dT%H:%M:%E3SZ", absl::Now(), absl::UTCTimeZone());
    std::fprintf(stderr, "%s worker=%s %s\n", time.c_str(), id_.c_str(), line.c_str());
  }

  const std::string id_;
  const std::unique_ptr<GrpcCoordinator> coordinator_;
  const std::unique_ptr<BlobStore> shared_blobs_;
  Agent agent_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<WorkerProgram>> WorkerProgram::Make(const WorkerSettings& settings) {
  std::unique_ptr<BlobStore> shared_blobs;
  if (!settings.blobs.empty()) {
    MW_ASSIGN_OR_RETURN(shared_blobs, OpenBlobStore(settings.blobs));
  }
  return std::make_unique<RealWorkerProgram>(settings, GrpcCoordinator::Connect(settings.coordinator),
                                             std::move(shared_blobs));
}

}  // namespace meshwright
