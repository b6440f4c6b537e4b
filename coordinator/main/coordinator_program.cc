// SPDX-License-Identifier: Apache-2.0
#include "coordinator/main/coordinator_program.h"

#include <algorithm>
#include <filesystem>
#include <utility>

#include <absl/strings/str_cat.h>
#include <malloc.h>
#include <nlohmann/json.hpp>
#include <unistd.h>

#include "pipeline/config/parse_config.h"
#include "pipeline/report/stored_verdict.h"

#include "common/base/clock.h"
#include "common/base/files.h"
#include "common/base/folder_lock.h"
#include "common/base/status_macros.h"
#include "common/base/thread_pool.h"
#include "common/base/token_file.h"
#include "common/blob/blob_store.h"
#include "common/blob/open_blob_store.h"
#include "common/telemetry/log.h"
#include "common/telemetry/measured_blob_store.h"
#include "common/telemetry/metrics.h"
#include "common/telemetry/metrics_server.h"
#include "coordinator/api/reconstruction_record.h"
#include "coordinator/api/reconstruction_service.h"
#include "coordinator/dispatch/worker_service.h"
#include "coordinator/grpc/grpc_server.h"
#include "coordinator/main/check_settings.h"
#include "coordinator/main/list_photographs.h"
#include "coordinator/main/open_gate.h"
#include "coordinator/main/open_job_store.h"
#include "coordinator/main/open_nodeodm.h"
#include "coordinator/main/open_rest.h"
#include "coordinator/nodeodm/nodeodm_server.h"
#include "coordinator/rest/rest_server.h"
#include "coordinator/store/job_store.h"
#include "coordinator/store/store_news.h"
#include "coordinator/telemetry/cluster_gauges.h"
#include "coordinator/telemetry/measured_sql_database.h"
#include "coordinator/telemetry/rpc_metrics.h"
#include "coordinator/webhook/webhook_sender.h"

namespace meshwright {
namespace {

namespace fs = std::filesystem;

// Another coordinator takes over so long after this one has died.
constexpr absl::Duration kConductorLease = absl::Seconds(5);

// Nobody writes one file for so long: its writer is dead.
constexpr absl::Duration kStalePartialFile = absl::Hours(24);

// The same for every process on this data folder, and no other.
std::string NameOf(const std::string& data_folder) {
  char host[256] = "";
  if (::gethostname(host, sizeof(host) - 1) != 0) host[0] = '\0';
  std::error_code error;
  const fs::path path = fs::canonical(data_folder, error);
  return absl::StrCat(host, ":", error ? data_folder : path.string());
}

// What the webhook tells: enough for a line in a chat and for a program that fetches the mesh.
std::string WebhookBody(const v1::Reconstruction& over) {
  nlohmann::ordered_json body = {{"id", over.id()}, {"state", InWords(over.state())}};
  if (!over.failure().empty()) body["failure"] = over.failure();
  body["path"] = absl::StrCat("/v1/reconstructions/", over.id());
  if (over.state() == v1::RECONSTRUCTION_STATE_DONE) {
    body["mesh"] = {{"vertices", over.progress().vertices()},
                    {"faces", over.progress().faces()},
                    {"bytes", over.mesh_bytes()},
                    {"sha256", over.mesh_sha256()}};
  }
  return body.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
}

class RealCoordinatorProgram final : public CoordinatorProgram {
 public:
  explicit RealCoordinatorProgram(const CoordinatorSettings& settings)
      : settings_(settings),
        lease_{.lease = absl::Seconds(settings.lease_seconds),
               .job_time_limit = absl::Seconds(settings.job_time_limit_seconds)},
        pool_(settings.threads) {}

  ~RealCoordinatorProgram() override {
    Shutdown(absl::Seconds(1));
    if (news_ != nullptr) news_->SetListener(nullptr);
  }

  absl::Status Open() {
    MW_RETURN_IF_ERROR(lease_.Validate());
    std::error_code error;
    fs::create_directories(settings_.data_folder, error);
    if (error) {
      return absl::PermissionDeniedError(
          absl::StrCat(settings_.data_folder, ": cannot make the folder: ", error.message()));
    }
    const std::string& data = settings_.data_folder;
    // Photographs, meshes and who may see them: nobody else's business on this machine.
    fs::permissions(data, fs::perms::owner_all, error);
    MW_ASSIGN_OR_RETURN(FolderLock lock, FolderLock::Acquire(data));
    data_lock_ = std::make_unique<FolderLock>(std::move(lock));
    RemoveStalePartialFiles(data, clock_.Now() - kStalePartialFile);
    const std::string where =
        settings_.store.empty() ? absl::StrCat("sqlite:", data, "/state.sqlite") : settings_.store;
    MW_ASSIGN_OR_RETURN(store_, OpenJobStore(where, [this](std::unique_ptr<SqlDatabase> database) {
                          auto measured = std::make_unique<MeasuredSqlDatabase>(std::move(database), metrics_, log_);
                          database_ = measured.get();
                          return measured;
                        }));
    MW_ASSIGN_OR_RETURN(unmeasured_blobs_,
                        OpenBlobStore(settings_.blobs.empty() ? absl::StrCat(data, "/blobs") : settings_.blobs));
    blobs_ = std::make_unique<MeasuredBlobStore>(*unmeasured_blobs_, metrics_);
    news_ = OpenStoreNews(where);
    MW_RETURN_IF_ERROR(OpenWebhook());
    workers_ = std::make_unique<WorkerService>(lease_, retry_, *store_);
    const DriverEnvironment environment = {.store = store_.get(),
                                           .blobs = blobs_.get(),
                                           .clock = &clock_,
                                           .pool = &pool_,
                                           .jobs_changed =
                                               [this] {
                                                 workers_->Wake();
                                                 TellOthers({StoreNews::About::kJobs, ""});
                                               },
                                           .parse_config = ParseConfig,
                                           .list_photographs = ListPhotographFiles,
                                           .make_verdict =
                                               [this](const std::string& id, const std::vector<JudgedCamera>& judged) {
                                                 return MakeStoredVerdict(id, judged, *store_, *blobs_);
                                               },
                                           .max_failures = retry_.max_failures};
    MW_ASSIGN_OR_RETURN(reconstructions_, ReconstructionService::Open(
                                              {.data_folder = data,
                                               .scene_roots = settings_.scene_roots,
                                               .name = NameOf(data),
                                               .conductor_lease = std::min(lease_.lease, kConductorLease),
                                               .ended = [this](const v1::Reconstruction& over) { TellEnd(over); },
                                               .tell_others = [this](const StoreNews& news) { TellOthers(news); }},
                                              environment, *workers_));
    if (news_ != nullptr) news_->SetListener([this](const StoreNews& news) { reconstructions_->Hear(news); });
    MW_ASSIGN_OR_RETURN(gate_, OpenGate(settings_, *store_, clock_, log_, metrics_));
    GrpcServer::Interceptors interceptors;
    interceptors.push_back(MakeRpcMetrics(metrics_));
    MW_ASSIGN_OR_RETURN(server_,
                        GrpcServer::Start({.listen = settings_.listen,
                                           .tls_certificate_file = settings_.tls_certificate_file,
                                           .tls_key_file = settings_.tls_key_file,
                                           .client_ca_file = settings_.client_ca_file,
                                           .reflection = settings_.grpc_reflection},
                                          *reconstructions_, *workers_, *blobs_, *gate_, std::move(interceptors)));
    MW_ASSIGN_OR_RETURN(rest_server_,
                        OpenRest(settings_, *reconstructions_, *workers_, *blobs_, *store_, *gate_, pool_, log_));
    MW_ASSIGN_OR_RETURN(nodeodm_server_,
                        OpenNodeOdm(settings_, *reconstructions_, *workers_, *blobs_, *gate_, clock_, log_));
    MW_RETURN_IF_ERROR(ServeMetrics());
    return absl::OkStatus();
  }

  int port() const override { return server_->port(); }
  int rest_port() const override { return rest_server_ != nullptr ? rest_server_->port() : 0; }
  int nodeodm_port() const override { return nodeodm_server_ != nullptr ? nodeodm_server_->port() : 0; }
  int metrics_port() const override { return metrics_server_ != nullptr ? metrics_server_->port() : 0; }

  void Shutdown(absl::Duration deadline) override {
    if (nodeodm_server_ != nullptr) nodeodm_server_->Shutdown();
    if (rest_server_ != nullptr) rest_server_->Shutdown();
    if (server_ != nullptr) server_->Shutdown(deadline);
  }

 private:
  absl::Status OpenWebhook() {
    if (settings_.webhook_url.empty()) return absl::OkStatus();
    WebhookOptions options = {.url = settings_.webhook_url};
    MW_ASSIGN_OR_RETURN(options.secret, ReadTokenFile(settings_.webhook_secret_file, "--webhook-secret-file"));
    options.warn = [this](const std::string& text) { log_.Warning(text); };
    webhook_ = std::make_unique<WebhookSender>(std::move(options));
    return absl::OkStatus();
  }

  void TellOthers(const StoreNews& news) {
    if (news_ != nullptr) news_->Tell(news);
  }

  void TellEnd(const v1::Reconstruction& over) {
    if (webhook_ != nullptr) webhook_->Send(WebhookBody(over));
  }

  absl::Status ServeMetrics() {
    if (settings_.metrics_listen.empty()) return absl::OkStatus();
    AddClusterGauges(metrics_, *database_, *workers_, settings_.data_folder);
    const auto ready = [this] { return database_->Now().status(); };
    MW_ASSIGN_OR_RETURN(metrics_server_, MetricsServer::Start(settings_.metrics_listen, metrics_, ready));
    return absl::OkStatus();
  }

  const CoordinatorSettings settings_;
  const LeaseOptions lease_;
  const RetryOptions retry_;
  const RealClock clock_;
  Metrics metrics_{"coordinator"};
  const Logger log_ = Logger::ToStderr();
  ThreadPool pool_;
  std::unique_ptr<FolderLock> data_lock_;
  std::unique_ptr<JobStore> store_;
  SqlDatabase* database_ = nullptr;         // the store's
  std::unique_ptr<StoreNewsChannel> news_;  // null: nobody else has the store
  std::unique_ptr<BlobStore> unmeasured_blobs_;
  std::unique_ptr<BlobStore> blobs_;
  std::unique_ptr<WebhookSender> webhook_;  // null: none
  std::unique_ptr<WorkerService> workers_;
  std::unique_ptr<ReconstructionService> reconstructions_;
  std::unique_ptr<Gatekeeper> gate_;
  std::unique_ptr<GrpcServer> server_;
  std::unique_ptr<RestServer> rest_server_;        // null: none
  std::unique_ptr<NodeOdmServer> nodeodm_server_;  // null: none
  std::unique_ptr<MetricsServer> metrics_server_;
};

}  // namespace

absl::Status CoordinatorProgram::Check(const CoordinatorSettings& settings) { return CheckSettings(settings); }

absl::StatusOr<std::unique_ptr<CoordinatorProgram>> CoordinatorProgram::Start(const CoordinatorSettings& settings) {
  MW_RETURN_IF_ERROR(CheckSettings(settings));
  // What is large, a photograph above all, goes back to the system when it is done with. By itself the allocator comes
  // to keep blocks of up to 32 MiB, for each thread some.
  ::mallopt(M_MMAP_THRESHOLD, 1 << 20);
  auto program = std::make_unique<RealCoordinatorProgram>(settings);
  MW_RETURN_IF_ERROR(program->Open());
  return program;
}

}  // namespace meshwright
