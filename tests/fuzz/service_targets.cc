// SPDX-License-Identifier: Apache-2.0
// What clients and workers say, to a whole coordinator but for its network.
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <absl/strings/str_cat.h>

#include "meshwright/v1/reconstruction.pb.h"
#include "meshwright/v1/worker.pb.h"
#include "pipeline/config/parse_config.h"
#include "pipeline/options/options_json.h"

#include "common/base/check.h"
#include "common/base/clock.h"
#include "common/base/method_version.h"
#include "common/base/temporary_folder_testing.h"
#include "common/base/thread_pool.h"
#include "common/blob/filesystem_blob_store.h"
#include "common/http_server/request_parser.h"
#include "coordinator/api/reconstruction_service.h"
#include "coordinator/auth/gatekeeper.h"
#include "coordinator/dispatch/worker_service.h"
#include "coordinator/nodeodm/form_body.h"
#include "coordinator/rest/routes.h"
#include "coordinator/store/sqlite_job_store.h"
#include "tests/fuzz/target.h"

namespace meshwright::fuzz {
namespace {

// A coordinator without workers. Never destroyed: its threads end with the process.
struct Service {
  Service() {
    store = *OpenSqliteJobStore(folder / "state.sqlite");
    blobs = *FilesystemBlobStore::Open(folder / "blobs");
    workers = std::make_unique<WorkerService>(LeaseOptions{.lease = absl::Milliseconds(100)}, RetryOptions(), *store);
    reconstructions = *ReconstructionService::Open(
        {.data_folder = folder / "data"},
        {.store = store.get(),
         .blobs = blobs.get(),
         .clock = &clock,
         .pool = &pool,
         .jobs_changed = [this] { workers->Wake(); },
         .parse_config = ParseConfig,
         .list_photographs = [](const std::string&) { return std::vector<PhotographFile>(); }},
        *workers);
    gate.emplace(GatekeeperOptions(), *store, clock);
    uploads = *SceneUploads::Open(folder / "uploads", *reconstructions);
    derived = *DerivedFiles::Open(folder / "derived");
    textured = *DerivedFiles::Open(folder / "textured");
    feeds = std::make_unique<EventFeeds>(*reconstructions, EventFeedOptions{.max_streams = 4});
    context = {.reconstructions = reconstructions.get(),
               .workers = workers.get(),
               .blobs = blobs.get(),
               .gate = &*gate,
               .uploads = uploads.get(),
               .derived = derived.get(),
               .textured = textured.get(),
               .feeds = feeds.get(),
               .ready = [] { return absl::OkStatus(); },
               .options_json = DescribeOptionsForRest(),
               .write_textured = [](const TextureRequest&) { return absl::UnimplementedError("not here"); }};
    router = std::make_unique<Router>(MakeRoutes(context));
    v1::CreateReconstructionRequest request;
    request.set_id("castle");
    MW_CHECK(reconstructions->Create(request).ok());
  }

  TemporaryFolder folder;
  RealClock clock;
  ThreadPool pool{1};
  std::unique_ptr<JobStore> store;
  std::unique_ptr<BlobStore> blobs;
  std::unique_ptr<WorkerService> workers;
  std::unique_ptr<ReconstructionService> reconstructions;
  std::optional<Gatekeeper> gate;
  std::unique_ptr<SceneUploads> uploads;
  std::unique_ptr<DerivedFiles> derived;
  std::unique_ptr<DerivedFiles> textured;
  std::unique_ptr<EventFeeds> feeds;
  RestContext context;
  std::unique_ptr<Router> router;
};

Service& TheService() {
  static auto* const service = new Service();
  return *service;
}

// A request's head and body as text, to whatever handler it finds.
void CallRest(const std::string& bytes) {
  const size_t end = bytes.find("\r\n\r\n");
  if (end == std::string::npos) return;
  RequestParser parser;
  HttpExchange exchange;
  if (parser.ParseHead(bytes.substr(0, end + 4), {.max_start_line_bytes = 8192, .max_fields = 100}, exchange.request)) {
    return;
  }
  RestCall call = {.request = exchange.request, .response = exchange.response};
  const absl::StatusOr<const Route*> route = TheService().router->Match(call);
  absl::Status status = route.status();
  if (route.ok()) status = (*route)->handler(call);
  AnswerStatus(status, exchange.response);
  if (status.ok() && call.body != nullptr) {
    const std::string body = bytes.substr(end + 4);
    call.body->Take(absl::MakeConstSpan(reinterpret_cast<const uint8_t*>(body.data()), body.size()));
    call.body->Finish(exchange);
  }
  MW_CHECK(exchange.response.status >= 200 && exchange.response.status < 600);
}

void CallAsWorker(const std::string& bytes) {
  v1::SynchronizeRequest request;
  if (!request.ParseFromString(bytes)) return;
  if (request.wait_timeout_seconds() > 0) request.set_wait_timeout_seconds(0);
  const auto answer = TheService().workers->Synchronize(request, [] { return false; });
  if (answer.ok()) MW_CHECK(answer->lease_seconds() > 0);
}

// The first byte says which call.
void CallGrpc(const std::string& bytes) {
  if (bytes.empty()) return;
  ReconstructionService& service = *TheService().reconstructions;
  const std::string message = bytes.substr(1);
  switch (bytes[0]) {
    case 'c': {
      v1::CreateReconstructionRequest request;
      if (!request.ParseFromString(message)) return;
      if (service.Create(request).ok() && request.id() != "castle") service.Delete(request.id()).IgnoreError();
      return;
    }
    case 'u': {
      v1::UploadSceneFileRequest::Header header;
      if (!header.ParseFromString(message)) return;
      auto upload = service.BeginUpload(header);
      if (upload.ok() && upload->Append("bytes").ok()) upload->Finish().IgnoreError();
      return;
    }
    case 'l': {
      v1::ListReconstructionsRequest request;
      if (request.ParseFromString(message)) service.List(request).status().IgnoreError();
      return;
    }
    case 'a': {
      v1::ListAttemptsRequest request;
      if (request.ParseFromString(message)) service.ListAttempts(request).status().IgnoreError();
      return;
    }
    default:
      service.Get(message).status().IgnoreError();
      service.Cancel(message == "castle" ? "" : message).status().IgnoreError();
  }
}

// What NodeODM's clients send: fields and files.
void ReadForm(const std::string& bytes) {
  int64_t taken = 0;
  const FormPartHandler files = {.begin = [](const FormPart&) { return absl::OkStatus(); },
                                 .append =
                                     [&](absl::Span<const uint8_t> piece) {
                                       taken += static_cast<int64_t>(piece.size());
                                       return absl::OkStatus();
                                     },
                                 .end = [] { return absl::OkStatus(); }};
  for (const char* type :
       {"multipart/form-data; boundary=x", "application/x-www-form-urlencoded", "application/json"}) {
    FormBody form(type, files);
    taken = 0;
    absl::Status status;
    for (size_t begin = 0; status.ok() && begin < bytes.size(); begin += 7) {
      const std::string piece = bytes.substr(begin, 7);
      status = form.Append(absl::MakeConstSpan(reinterpret_cast<const uint8_t*>(piece.data()), piece.size()));
    }
    if (status.ok()) form.Finish().IgnoreError();
    MW_CHECK(taken <= static_cast<int64_t>(bytes.size()));
  }
}

std::string WorkerSeed() {
  v1::SynchronizeRequest request;
  request.set_worker_id("w");
  request.set_instance("1");
  request.set_cores(2);
  request.set_memory_bytes(1 << 30);
  request.set_method_version(kMethodVersion);
  v1::HeldJob& held = *request.add_held();
  held.mutable_key()->set_reconstruction_id("castle");
  held.mutable_key()->set_sequence(1);
  held.mutable_finished()->set_filtered_digest(std::string(64, 'a'));
  held.mutable_finished()->set_report_json("{}");
  return request.SerializeAsString();
}

std::vector<std::string> GrpcSeeds() {
  v1::CreateReconstructionRequest create;
  create.set_id("tower");
  create.set_options_json(R"({"window": 4})");
  create.set_weight(2);
  v1::UploadSceneFileRequest::Header header;
  header.set_reconstruction_id("castle");
  header.set_path("images/1.png");
  header.set_size_bytes(5);
  header.set_sha256(std::string(64, 'a'));
  v1::ListReconstructionsRequest list;
  list.set_page_size(3);
  list.set_page_token("castle");
  v1::ListAttemptsRequest attempts;
  attempts.set_id("castle");
  return {"c" + create.SerializeAsString(), "u" + header.SerializeAsString(), "l" + list.SerializeAsString(),
          "a" + attempts.SerializeAsString(), "gcastle"};
}

std::vector<std::string> RestSeeds() {
  std::vector<std::string> seeds;
  for (const char* path :
       {"", "/castle", "/castle/files", "/castle/files/a%2Fb", "/castle/cameras", "/castle/incidence",
        "/castle/attempts?pageSize=2", "/castle/log", "/castle/parts", "/castle/parts/1/preview?maxFaces=100",
        "/castle/mesh.glb", "/castle/cameras/0/photo?width=64", "/castle/events?after=1"}) {
    seeds.push_back(absl::StrCat("GET /v1/reconstructions", path, " HTTP/1.1\r\nHost: a\r\n\r\n"));
  }
  const std::string json = "HTTP/1.1\r\nHost: a\r\nContent-Type: application/json\r\nContent-Length: 9\r\n\r\n";
  seeds.push_back("POST /v1/reconstructions " + json + R"({"id": "castle", "optionsJson": "{\"window\": 4}"})");
  seeds.push_back("POST /v1/reconstructions/castle:again " + json + R"({"id": "tower", "options": {"support": 2}})");
  seeds.push_back("POST /v1/workers/w:drain HTTP/1.1\r\nHost: a\r\n\r\n");
  seeds.push_back(absl::StrCat("PUT /v1/reconstructions/castle/files/a?size=5&offset=0&sha256=", std::string(64, 'a'),
                               " HTTP/1.1\r\nHost: a\r\nContent-Length: 5\r\n\r\nbytes"));
  return seeds;
}

}  // namespace

std::vector<Target> ServiceTargets() {
  return {{"rest_call", CallRest, RestSeeds(), {"/v1/", ":start", ":cancel", "?pageToken=", "Range: bytes=", "%00"}},
          {"grpc_call", CallGrpc, GrpcSeeds(), {"castle", "../", "file:", R"({"window":)"}},
          {"worker_call", CallAsWorker, {WorkerSeed(), ""}, {"castle", std::string(64, 'a'), "{}"}},
          {"form",
           ReadForm,
           {"--x\r\nContent-Disposition: form-data; name=\"images\"; filename=\"a.png\"\r\n\r\nbytes\r\n--x--\r\n",
            "name=a+b&options=%5B%5D&uuid=1", R"({"uuid": "1", "options": "[]"})"},
           {"--x", "\r\n\r\n", "Content-Disposition: form-data; name=", "filename*=UTF-8''", "%", "\"options\":"}}};
}

}  // namespace meshwright::fuzz
