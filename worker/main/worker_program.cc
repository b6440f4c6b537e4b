// SPDX-License-Identifier: Apache-2.0
#include "worker/main/worker_program.h"

#include <algorithm>
#include <filesystem>
#include <system_error>
#include <utility>

#include <absl/strings/ascii.h>
#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <unistd.h>

#include "common/base/clock.h"
#include "common/base/files.h"
#include "common/base/host_port.h"
#include "common/base/status_macros.h"
#include "common/base/version.h"
#include "common/blob/open_blob_store.h"
#include "common/telemetry/log.h"
#include "common/telemetry/measured_blob_store.h"
#include "common/telemetry/metrics.h"
#include "common/telemetry/metrics_server.h"
#include "worker/agent/agent.h"
#include "worker/agent/grpc_coordinator.h"
#include "worker/main/camera_refiner.h"
#include "worker/main/colmap_estimator.h"
#include "worker/main/parse_job_config.h"
#include "worker/telemetry/measured_worker_channel.h"

namespace meshwright {
namespace {

int64_t MemoryMib(const WorkerSettings& settings) {
  return settings.memory_mib > 0 ? settings.memory_mib : std::max<int64_t>(1024, int64_t{512} * settings.cores);
}

absl::StatusOr<CoordinatorCredentials> ReadCredentials(const WorkerSettings& settings) {
  CoordinatorCredentials credentials;
  if (!settings.token_file.empty()) {
    MW_ASSIGN_OR_RETURN(const std::string text, ReadFile(settings.token_file));
    credentials.key = std::string(absl::StripAsciiWhitespace(text));
  }
  if (!settings.ca_file.empty()) {
    MW_ASSIGN_OR_RETURN(credentials.ca_certificates, ReadFile(settings.ca_file));
  }
  if (settings.client_certificate_file.empty() != settings.client_key_file.empty()) {
    return absl::InvalidArgumentError("--client-cert and --client-key: expected both or none");
  }
  if (!settings.client_certificate_file.empty()) {
    if (settings.ca_file.empty()) return absl::InvalidArgumentError("--client-cert: expected with --ca-file");
    MW_ASSIGN_OR_RETURN(credentials.certificate, ReadFile(settings.client_certificate_file));
    MW_ASSIGN_OR_RETURN(credentials.private_key, ReadFile(settings.client_key_file));
  }
  return credentials;
}

// The same for all workers of a user on this machine: what one began another one goes on with.
std::string WorkFolder() {
  std::error_code error;
  const std::filesystem::path temporary = std::filesystem::temp_directory_path(error);
  return absl::StrCat(error ? "/tmp" : temporary.string(), "/meshwright-worker-", ::getuid());
}

CameraEstimator FindEstimator(const Logger& log) {
  std::string why_not;
  CameraEstimator estimator = MakeColmapEstimator(&why_not);
  if (why_not.empty()) {
    log.Info("estimates cameras", {{"colmap", estimator.colmap_version}});
  } else {
    log.Info("does not estimate cameras", {{"reason", why_not}});
  }
  return estimator;
}

class RealWorkerProgram final : public WorkerProgram {
 public:
  RealWorkerProgram(const WorkerSettings& settings, std::unique_ptr<GrpcCoordinator> coordinator,
                    std::unique_ptr<BlobStore> shared_blobs)
      : id_(settings.id.empty() ? DefaultWorkerId() : settings.id),
        log_(Logger::ToStderr().With({{"worker", id_}})),
        coordinator_(std::move(coordinator)),
        shared_blobs_(std::move(shared_blobs)),
        metrics_("worker"),
        channel_(*coordinator_, metrics_, clock_),
        blobs_(shared_blobs_ != nullptr ? *shared_blobs_ : *coordinator_, metrics_),
        agent_(
            {.worker_id = id_,
             .version = kProgramVersion,
             .cores = settings.cores,
             .memory_bytes = MemoryMib(settings) << 20,
             .drain = absl::Seconds(settings.drain_seconds),
             .exit_when_idle = settings.exit_when_idle_seconds > 0 ? absl::Seconds(settings.exit_when_idle_seconds)
                                                                   : absl::InfiniteDuration(),
             .ran_out_of_memory = settings.ran_out_of_memory,
             .work_folder = WorkFolder(),
             .estimator = FindEstimator(log_),
             .refiner = MakeCameraRefiner()},
            channel_, blobs_, ParseJobConfig,
            [](const CameraJobInput& input, const CameraJobOptions& options, ThreadPool& pool) {
              return RunCameraJob(input, options, pool);
            },
            log_) {}

  absl::Status ServeMetrics(const std::string& address) {
    MW_ASSIGN_OR_RETURN(metrics_server_, MetricsServer::Start(address, metrics_, [this] { return channel_.Ready(); }));
    return absl::OkStatus();
  }

  void Run() override { agent_.Run(); }
  int metrics_port() const override { return metrics_server_ != nullptr ? metrics_server_->port() : 0; }
  void Drain() override {
    log_.Info("draining");
    agent_.Drain();
  }

 private:
  const std::string id_;
  const Logger log_;
  const std::unique_ptr<GrpcCoordinator> coordinator_;
  const std::unique_ptr<BlobStore> shared_blobs_;
  const RealClock clock_;
  Metrics metrics_;
  MeasuredWorkerChannel channel_;
  MeasuredBlobStore blobs_;
  Agent agent_;
  std::unique_ptr<MetricsServer> metrics_server_;
};

}  // namespace

std::string DefaultWorkerId() {
  char host[64] = "worker";
  if (::gethostname(host, sizeof(host) - 1) != 0) host[0] = '\0';
  return absl::StrCat(host, "-", ::getpid());
}

absl::Status WorkerProgram::Check(const WorkerSettings& settings) {
  MW_ASSIGN_OR_RETURN(const HostPort coordinator, ParseHostPort(settings.coordinator, "--coordinator"));
  if (coordinator.port == 0) return absl::InvalidArgumentError("--coordinator has port 0, expected 1 to 65535");
  if (!settings.metrics_listen.empty()) {
    MW_RETURN_IF_ERROR(ParseHostPort(settings.metrics_listen, "--metrics-listen").status());
  }
  MW_RETURN_IF_ERROR(ReadCredentials(settings).status());
  const bool is_folder = !absl::StrContains(settings.blobs, "://");
  if (is_folder || ParseS3Url(settings.blobs).ok()) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat("--blobs is ", settings.blobs, ", expected a folder or s3://BUCKET/PREFIX"));
}

absl::StatusOr<std::unique_ptr<WorkerProgram>> WorkerProgram::Make(const WorkerSettings& settings) {
  MW_RETURN_IF_ERROR(Check(settings));
  std::unique_ptr<BlobStore> shared_blobs;
  if (!settings.blobs.empty()) {
    MW_ASSIGN_OR_RETURN(shared_blobs, OpenBlobStore(settings.blobs));
  }
  MW_ASSIGN_OR_RETURN(const CoordinatorCredentials credentials, ReadCredentials(settings));
  auto program = std::make_unique<RealWorkerProgram>(
      settings, GrpcCoordinator::Connect(settings.coordinator, credentials), std::move(shared_blobs));
  if (!settings.metrics_listen.empty()) MW_RETURN_IF_ERROR(program->ServeMetrics(settings.metrics_listen));
  return program;
}

}  // namespace meshwright
