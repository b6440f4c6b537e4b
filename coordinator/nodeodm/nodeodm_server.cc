// SPDX-License-Identifier: Apache-2.0
#include "coordinator/nodeodm/nodeodm_server.h"

#include <algorithm>
#include <filesystem>
#include <optional>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

#include <absl/strings/match.h>
#include <absl/strings/numbers.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_split.h>
#include <nlohmann/json.hpp>

#include "common/base/relative_path.h"
#include "common/base/status_macros.h"
#include "common/base/version.h"
#include "common/blob/staged_blob.h"
#include "common/http_server/byte_range.h"
#include "common/http_server/foreign_requests.h"
#include "common/http_server/http_server.h"
#include "common/json/parse_json.h"
#include "coordinator/nodeodm/form_body.h"
#include "coordinator/nodeodm/odm_options.h"
#include "coordinator/nodeodm/odm_task.h"
#include "coordinator/nodeodm/task_board.h"

namespace meshwright {
namespace {

using Json = nlohmann::ordered_json;

// Clients compare it: uploads in pieces from 1.4 on, lines of output with the state from 1.5.1 on.
constexpr char kProtocolVersion[] = "2.2.1";
constexpr char kJsonType[] = "application/json";
constexpr char kBadToken[] = "Invalid authentication token: token does not match.";
constexpr int64_t kMaxBodyBytes = int64_t{1} << 40;
// Bytes of a form that does not say how long it is are counted in such steps.
constexpr int64_t kReserveBytes = int64_t{64} << 20;
constexpr int64_t kMaxIgnoredBytes = int64_t{1} << 20;
constexpr size_t kMaxOutputs = 1000;
constexpr int kMinWorkers = 4;
constexpr absl::Duration kShutdownGrace = absl::Seconds(2);

void Answer(HttpResponse& response, const Json& json) {
  response.status = 200;
  response.SetContent(json.dump(-1, ' ', false, Json::error_handler_t::replace), kJsonType);
}

// Whether sending the same again cannot help.
bool IsForGood(const absl::Status& status) {
  return absl::IsInvalidArgument(status) || absl::IsNotFound(status) || absl::IsFailedPrecondition(status);
}

// Errors have the status 200; clients look for the key. `noRetry` is what keeps them from sending files again.
void AnswerError(HttpResponse& response, const absl::Status& status) {
  Json json = {{"error", std::string(status.message())}};
  if (IsForGood(status)) json["noRetry"] = true;
  Answer(response, json);
  if (absl::IsUnavailable(status) || absl::IsResourceExhausted(status)) response.status = 503;
  if (absl::IsPermissionDenied(status)) response.status = 403;
}

// A quota does not grow by sending again, and clients would.
absl::Status ForGood(const absl::Status& status) {
  return absl::IsResourceExhausted(status) ? absl::FailedPreconditionError(status.message()) : status;
}

void AnswerSuccess(HttpResponse& response, const absl::Status& status) {
  if (status.ok()) return Answer(response, {{"success", true}});
  Json json = {{"success", false}, {"error", std::string(status.message())}};
  Answer(response, json);
}

// What nobody has adopted is removed.
struct RemoveStaged {
  void operator()(StagedBlob* file) const {
    std::error_code error;
    std::filesystem::remove(file->path(), error);
    delete file;
  }
};
using StagedFile = std::unique_ptr<StagedBlob, RemoveStaged>;

// What a form that is on its way may bring. It counts as its caller's until it is over.
class FormAllowance {
 public:
  FormAllowance(Gatekeeper& gate, Caller caller) : gate_(gate), caller_(std::move(caller)), name_(DrawUuid()) {}
  ~FormAllowance() { gate_.ReleaseSceneBytes("", name_); }
  FormAllowance(const FormAllowance&) = delete;
  FormAllowance& operator=(const FormAllowance&) = delete;

  absl::Status Reserve(int64_t bytes) {
    reserved_bytes_ = bytes;
    return ForGood(gate_.ReserveBytes(caller_, name_, bytes));
  }
  absl::Status Take(size_t bytes) {
    taken_bytes_ += static_cast<int64_t>(bytes);
    return taken_bytes_ <= reserved_bytes_ ? absl::OkStatus() : Reserve(taken_bytes_ + kReserveBytes);
  }

 private:
  Gatekeeper& gate_;
  const Caller caller_;
  const std::string name_;
  int64_t reserved_bytes_ = 0;
  int64_t taken_bytes_ = 0;
};

// A file among the images of a form, on its way.
class Incoming {
 public:
  using Keep = std::function<absl::Status(const std::string& name, StagedFile file)>;
  Incoming(std::string folder, std::unique_ptr<FormAllowance> allowance, Keep keep)
      : folder_(std::move(folder)), allowance_(std::move(allowance)), keep_(std::move(keep)) {}

  FormPartHandler Handler() {
    return {.begin = [this](const FormPart& part) -> absl::Status {
              MW_ASSIGN_OR_RETURN(const std::string path, StagedBlob::NewPath(folder_));
              MW_ASSIGN_OR_RETURN(std::unique_ptr<StagedBlob> file, StagedBlob::Open(path));
              file_ = StagedFile(file.release());
              name_ = part.file_name;
              return absl::OkStatus();
            },
            .append = [this](absl::Span<const uint8_t> bytes) -> absl::Status {
              MW_RETURN_IF_ERROR(allowance_->Take(bytes.size()));
              return file_->Append(bytes);
            },
            .end =
                [this] {
                  ++count_;
                  return keep_(name_, std::move(file_));
                }};
  }
  int count() const { return count_; }

 private:
  const std::string folder_;
  const std::unique_ptr<FormAllowance> allowance_;
  const Keep keep_;
  std::string name_;
  StagedFile file_;
  int count_ = 0;
};

// A form that is read as it comes and answered at its end.
class FormSink final : public HttpBodySink {
 public:
  using Reply = std::function<void(FormBody& form, HttpResponse& response)>;
  FormSink(const std::string& content_type, std::shared_ptr<Incoming> incoming, Reply reply)
      : incoming_(std::move(incoming)),
        form_(content_type, incoming_ == nullptr ? FormPartHandler() : incoming_->Handler()),
        reply_(std::move(reply)) {}

  int64_t max_bytes() const override { return kMaxBodyBytes; }
  bool Take(absl::Span<const uint8_t> bytes) override {
    status_ = form_.Append(bytes);
    return status_.ok();
  }
  void Finish(HttpExchange& exchange) override {
    if (status_.ok()) status_ = form_.Finish();
    if (!status_.ok()) return AnswerError(exchange.response, status_);
    reply_(form_, exchange.response);
  }

 private:
  const std::shared_ptr<Incoming> incoming_;
  FormBody form_;
  const Reply reply_;
  absl::Status status_;
};

// A body that nobody needs.
class IgnoredBody final : public HttpBodySink {
 public:
  explicit IgnoredBody(std::function<void(HttpResponse&)> reply) : reply_(std::move(reply)) {}
  int64_t max_bytes() const override { return kMaxIgnoredBytes; }
  bool Take(absl::Span<const uint8_t>) override { return true; }
  void Finish(HttpExchange& exchange) override { reply_(exchange.response); }

 private:
  const std::function<void(HttpResponse&)> reply_;
};

// The fields of /task/new/init and /task/new.
absl::StatusOr<NewOdmTask> ParseNewTask(const FormBody& form, const std::string& set_uuid) {
  NewOdmTask task = {.uuid = set_uuid,
                     .name = form.Field("name").value_or(""),
                     .options = form.Field("options").value_or(""),
                     .webhook = form.Field("webhook").value_or("")};
  if (form.Field("zipurl")) return absl::InvalidArgumentError("zipurl is not supported here");
  constexpr size_t kMaxName = 512;
  if (task.name.size() > kMaxName) task.name.resize(kMaxName);
  int64_t created_ms = 0;
  if (absl::SimpleAtoi(form.Field("dateCreated").value_or(""), &created_ms) && created_ms > 0) {
    task.created_ms = created_ms;
  }
  const std::string outputs = form.Field("outputs").value_or("");
  if (outputs.empty()) return task;
  const auto parsed = ParseJson(outputs);
  if (!parsed.ok() || !parsed->is_array() || parsed->size() > kMaxOutputs) {
    return absl::InvalidArgumentError("outputs is no JSON array of paths");
  }
  for (const nlohmann::json& output : *parsed) {
    std::string path = output.is_string() ? output.get<std::string>() : "";
    while (!path.empty() && path.back() == '/') path.pop_back();
    if (!ValidateRelativePath(path).ok()) {
      return absl::InvalidArgumentError(absl::StrCat("Invalid output path ", path.substr(0, 64)));
    }
    task.outputs.push_back(path);
  }
  return task;
}

class RealNodeOdmServer final : public NodeOdmServer, private HttpHandler {
 public:
  RealNodeOdmServer(const NodeOdmOptions& options, const NodeOdmServices& services)
      : options_(options), services_(services), task_options_(services.options_json) {}
  ~RealNodeOdmServer() override { Shutdown(); }

  absl::Status Open() {
    MW_ASSIGN_OR_RETURN(
        board_, TaskBoard::Open(options_.folder, {.reconstructions = services_.reconstructions,
                                                  .gate = services_.gate,
                                                  .blobs = services_.blobs,
                                                  .options = &task_options_,
                                                  .clock = services_.clock,
                                                  .write_textured_glb = services_.write_textured_glb,
                                                  .can_estimate_cameras = [this] { return CanEstimateCameras(); },
                                                  .max_images = options_.max_images,
                                                  .warn = options_.warn}));
    const int cores = static_cast<int>(std::thread::hardware_concurrency());
    auto started = HttpServer::Start({.listen = options_.listen,
                                      .tls_certificate_file = options_.tls_certificate_file,
                                      .tls_key_file = options_.tls_key_file,
                                      .trusted_proxies = options_.trusted_proxies,
                                      .worker_threads = std::max(kMinWorkers, 2 * cores),
                                      .warn = options_.warn},
                                     *this);
    if (!started.ok()) {
      return absl::Status(started.status().code(), absl::StrCat("nodeodm: ", std::string(started.status().message())));
    }
    server_ = *std::move(started);
    return absl::OkStatus();
  }

  int port() const override { return server_->port(); }
  void Shutdown() override {
    if (server_ != nullptr) server_->Shutdown(kShutdownGrace);
  }

 private:
  bool CanEstimateCameras() const {
    const v1::ListWorkersResponse workers = services_.workers->ListWorkers();
    return std::any_of(workers.workers().begin(), workers.workers().end(),
                       [](const v1::Worker& worker) { return !worker.colmap_version().empty(); });
  }

  // Clients take a node that does not answer at once for dead. These wait for neither the store nor the disk; other
  // keys than the operator's are looked up in the store.
  bool IsQuick(const HttpRequest& request) const override {
    return request.method == "GET" && !absl::EndsWith(request.path, ".zip") &&
           services_.gate->KnowsAtOnce(request.Param("token"));
  }

  void AnswerFault(const HttpFault& fault, HttpResponse& response) override {
    const std::string detail = fault.detail.empty() ? absl::StrCat("HTTP status ", fault.status) : fault.detail;
    AnswerError(response, absl::InvalidArgumentError(detail));
    response.status = fault.status;
  }

  void Handle(HttpExchange& exchange) override {
    const HttpRequest& request = exchange.request;
    HttpResponse& response = exchange.response;
    response.headers.Set("X-Content-Type-Options", "nosniff");
    response.headers.Set("Cache-Control", "no-store");
    if (request.path == "/auth/info" && request.method == "GET") {
      return Answer(
          response,
          {{"message", "A token is given by whoever runs this node"}, {"loginUrl", nullptr}, {"registerUrl", nullptr}});
    }
    if (const absl::Status own = CheckOwnPage(request); !own.ok()) {
      AnswerError(response, own);
      return DropBody(exchange);
    }
    const absl::StatusOr<Caller> caller = services_.gate->Identify(request.Param("token"), request.caller);
    if (!caller.ok()) {
      RefuseKey(caller.status(), response);
      return DropBody(exchange);
    }
    const std::vector<std::string> path =
        absl::StrSplit(request.path.substr(std::min<size_t>(1, request.path.size())), '/');
    if (OnlyReads(request)) return Get(*caller, path, request, response);
    if (request.method == "POST") return Post(*caller, path, exchange);
    Answer(response, {{"error", "Method not allowed"}});
  }

  // A page in somebody's browser could send forms here.
  absl::Status CheckOwnPage(const HttpRequest& request) const {
    if (IsRebound(request, options_.listen, options_.trusted_proxies)) {
      return absl::PermissionDeniedError("Host is no name of this machine, expected localhost");
    }
    if (IsForeign(request)) return absl::PermissionDeniedError("Origin is another site, expected this one or none");
    return absl::OkStatus();
  }

  // Clients know a wrong token by its words, with the status 200.
  static void RefuseKey(const absl::Status& why, HttpResponse& response) {
    if (absl::IsUnauthenticated(why)) return Answer(response, {{"error", kBadToken}});
    AnswerError(response, why);
    if (!absl::IsResourceExhausted(why)) return;
    response.status = 429;
    response.headers.Set("Retry-After", "1");
  }

  // Whether the caller may do this with the task; for others it does not exist.
  absl::Status CheckTask(const Caller& caller, Action action, const std::string& deed, const std::string& uuid) const {
    const Request request = {.action = action, .deed = IsUuid(uuid) ? absl::StrCat(deed, " ", uuid) : deed};
    MW_RETURN_IF_ERROR(services_.gate->Check(caller, request));
    const absl::StatusOr<std::string> owner = board_->OwnerOf(uuid);
    if (!owner.ok()) return owner.status();
    return MaySee(caller, uuid, *owner) ? absl::OkStatus() : services_.gate->Refused(caller, request, NoSuchTask());
  }

  // A client that is still sending would not read an answer in between. Of one that has much to send the connection is
  // closed behind the answer.
  static void DropBody(HttpExchange& exchange) {
    if (!exchange.request.has_body) return;
    int64_t bytes = 0;
    const bool is_known = absl::SimpleAtoi(exchange.request.headers.Get("Content-Length"), &bytes);
    if (is_known && bytes > kMaxIgnoredBytes) return;
    exchange.body =
        std::make_unique<IgnoredBody>([status = exchange.response.status, headers = exchange.response.headers,
                                       content = exchange.response.content](HttpResponse& response) {
          response.headers = headers;
          response.SetContent(content, kJsonType);
          response.status = status;
        });
  }

  void Get(const Caller& caller, const std::vector<std::string>& path, const HttpRequest& request,
           HttpResponse& response) {
    if (path.size() == 1 && path[0] == "info") return Info(request, response);
    if (path.size() == 1 && path[0] == "options") return response.SetContent(task_options_.description(), kJsonType);
    if (path.size() == 2 && path[0] == "task" && path[1] == "list") return List(caller, response);
    const bool is_of_task = path.size() >= 3 && path[0] == "task";
    if (is_of_task && path.size() == 3 && (path[2] == "info" || path[2] == "output")) {
      const absl::Status may = CheckTask(caller, Action::kRead, "GET /task/" + path[2], path[1]);
      if (absl::IsNotFound(may))
        return Answer(response, {{"error", absl::StrCat(path[1].substr(0, 64), " not found")}});
      if (!may.ok()) return AnswerError(response, may);
      return path[2] == "info" ? TaskInfo(path[1], request, response) : Output(path[1], request, response);
    }
    if (is_of_task && path.size() == 4 && path[2] == "download") {
      const absl::Status may = CheckTask(caller, Action::kRead, "GET /task/download", path[1]);
      return may.ok() ? Download(path[1], path[3], request, response) : AnswerError(response, may);
    }
    Answer(response, {{"error", "There is nothing at this path"}});
  }

  void Info(const HttpRequest& request, HttpResponse& response) {
    if (request.HasParam("_debugUnauthorized")) {  // CloudODM's tests ask for it
      Answer(response, {{"error", "unauthorized"}});
      response.status = 401;
      return;
    }
    int cores = 0;
    int64_t memory = 0;
    int busy = 0;
    const v1::ListWorkersResponse workers = services_.workers->ListWorkers();
    for (const v1::Worker& worker : workers.workers()) {
      cores += worker.cores();
      memory += worker.memory_bytes();
      busy += worker.jobs();
    }
    const int64_t available = cores > 0 ? memory * std::max(0, cores - busy) / cores : 0;
    Json info = {{"version", kProtocolVersion},
                 {"taskQueueCount", board_->queued_or_running()},
                 {"totalMemory", memory},
                 {"availableMemory", available},
                 {"cpuCores", cores},
                 {"maxImages", nullptr},
                 // Tasks share the workers; more of them than cores would only wait.
                 {"maxParallelTasks", std::max(1, cores)},
                 {"engineVersion", kProgramVersion},
                 {"engine", "meshwright"}};
    if (options_.max_images > 0) info["maxImages"] = options_.max_images;
    Answer(response, info);
  }

  void List(const Caller& caller, HttpResponse& response) {
    const absl::Status may = services_.gate->Check(caller, {.action = Action::kList, .deed = "GET /task/list"});
    if (!may.ok()) return AnswerError(response, may);
    Json list = Json::array();
    for (const std::string& uuid : board_->List(caller)) list.push_back({{"uuid", uuid}});
    Answer(response, list);
  }

  static std::optional<size_t> Line(const HttpRequest& request, const char* name) {
    if (!request.HasParam(name)) return std::nullopt;
    int64_t line = 0;
    if (!absl::SimpleAtoi(request.Param(name), &line) || line < 0) line = 0;
    return static_cast<size_t>(line);
  }

  void TaskInfo(const std::string& uuid, const HttpRequest& request, HttpResponse& response) {
    const auto task = board_->Get(uuid);
    if (!task.ok()) return Answer(response, {{"error", absl::StrCat(uuid.substr(0, 64), " not found")}});
    Json info = DescribeTask(*task, board_->now_ms());
    if (const auto line = Line(request, "with_output")) {
      const auto output = board_->Output(uuid, *line);
      if (output.ok()) info["output"] = *output;
    }
    Answer(response, info);
  }

  void Output(const std::string& uuid, const HttpRequest& request, HttpResponse& response) {
    const auto output = board_->Output(uuid, Line(request, "line").value_or(0));
    if (!output.ok()) return Answer(response, {{"error", absl::StrCat(uuid.substr(0, 64), " not found")}});
    Answer(response, *output);
  }

  void Download(const std::string& uuid, const std::string& asset, const HttpRequest& request, HttpResponse& response) {
    if (asset != "all.zip") return Answer(response, {{"error", "Invalid asset"}});
    auto archive = board_->Archive(uuid);
    if (!archive.ok()) return AnswerError(response, archive.status());
    const int64_t size = (*archive)->size_bytes();
    response.headers.Set("Accept-Ranges", "bytes");
    response.headers.Set("Content-Disposition", "attachment; filename=\"all.zip\"");
    const ByteRange range = ParseByteRange(request.headers.Get("Range"), size);
    if (range.kind == ByteRange::Kind::kUnsatisfiable) {
      response.headers.Set("Content-Range", absl::StrCat("bytes */", size));
      AnswerError(response, absl::OutOfRangeError("Range is beyond the file"));
      response.status = 416;
      return;
    }
    response.status = 200;
    if (range.kind == ByteRange::Kind::kPart) {
      response.status = 206;
      response.headers.Set("Content-Range",
                           absl::StrCat("bytes ", range.first, "-", range.first + range.count - 1, "/", size));
    }
    response.SetPieces(range.count, "application/zip",
                       [archive = *std::move(archive), first = range.first](int64_t offset, size_t most) {
                         return archive->Read(first + offset, most);
                       });
  }

  void Post(const Caller& caller, const std::vector<std::string>& path, HttpExchange& exchange) {
    const bool is_new = path.size() >= 2 && path[0] == "task" && path[1] == "new";
    if (is_new && path.size() == 2) return NewTask(caller, exchange);
    if (is_new && path.size() == 3 && path[2] == "init") return Init(caller, exchange);
    if (is_new && path.size() == 4 && path[2] == "upload") return Upload(caller, path[3], exchange);
    if (is_new && path.size() == 4 && path[2] == "commit") return Commit(caller, path[3], exchange);
    if (path.size() == 2 && path[0] == "task" && (path[1] == "cancel" || path[1] == "remove" || path[1] == "restart")) {
      return Change(caller, path[1], exchange);
    }
    Answer(exchange.response, {{"error", path[0] == "auth" ? "Not available" : "There is nothing at this path"}});
    DropBody(exchange);
  }

  static void Refuse(HttpExchange& exchange, const absl::Status& why) {
    AnswerError(exchange.response, why);
    DropBody(exchange);
  }

  // For the body that is to come, as long as it says to be.
  absl::StatusOr<std::unique_ptr<FormAllowance>> Allow(const Caller& caller, const HttpRequest& request) {
    auto allowance = std::make_unique<FormAllowance>(*services_.gate, caller);
    int64_t bytes = 0;
    if (!absl::SimpleAtoi(request.headers.Get("Content-Length"), &bytes)) bytes = kReserveBytes;
    MW_RETURN_IF_ERROR(allowance->Reserve(bytes));
    return allowance;
  }

  static void TakeForm(HttpExchange& exchange, std::shared_ptr<Incoming> incoming, FormSink::Reply reply) {
    const std::string content_type = exchange.request.headers.Get("Content-Type");
    auto sink = std::make_unique<FormSink>(content_type, std::move(incoming), std::move(reply));
    if (exchange.request.has_body) {
      exchange.body = std::move(sink);
    } else {
      sink->Finish(exchange);
    }
  }

  void Init(const Caller& caller, HttpExchange& exchange) {
    const absl::Status may = services_.gate->Check(caller, {.action = Action::kCreate, .deed = "POST /task/new/init"});
    if (!may.ok()) return Refuse(exchange, may);
    const std::string set_uuid = exchange.request.headers.Get("set-uuid");
    TakeForm(exchange, nullptr, [this, caller, set_uuid](FormBody& form, HttpResponse& response) {
      auto task = ParseNewTask(form, set_uuid);
      const auto uuid = task.ok() ? board_->Begin(caller, *task) : task.status();
      if (!uuid.ok()) return AnswerError(response, ForGood(uuid.status()));
      Answer(response, {{"uuid", *uuid}});
    });
  }

  void Upload(const Caller& caller, const std::string& uuid, HttpExchange& exchange) {
    absl::Status takes = CheckTask(caller, Action::kChange, "POST /task/new/upload", uuid);
    if (takes.ok()) takes = board_->CheckTakesFiles(uuid);
    if (!takes.ok()) return Refuse(exchange, takes);
    absl::StatusOr<std::unique_ptr<FormAllowance>> allowance = Allow(caller, exchange.request);
    if (!allowance.ok()) return Refuse(exchange, allowance.status());
    auto incoming = std::make_shared<Incoming>(
        board_->staging_folder(), *std::move(allowance),
        [this, uuid](const std::string& name, StagedFile file) { return board_->TakeFile(uuid, name, *file); });
    TakeForm(exchange, incoming, [incoming](FormBody&, HttpResponse& response) {
      if (incoming->count() == 0) return AnswerError(response, absl::InvalidArgumentError("Need at least 1 file."));
      Answer(response, {{"success", true}});
    });
  }

  void Commit(const Caller& caller, const std::string& uuid, HttpExchange& exchange) {
    const absl::Status may = CheckTask(caller, Action::kChange, "POST /task/new/commit", uuid);
    if (!may.ok()) return Refuse(exchange, may);
    const auto commit = [this, uuid](HttpResponse& response) {
      const absl::Status status = board_->Commit(uuid);
      if (!status.ok()) return AnswerError(response, status);
      Answer(response, {{"uuid", uuid}});
    };
    if (!exchange.request.has_body) return commit(exchange.response);
    exchange.body = std::make_unique<IgnoredBody>(commit);
  }

  // Fields may come behind the files, and a task needs its fields to begin.
  void NewTask(const Caller& caller, HttpExchange& exchange) {
    const absl::Status may = services_.gate->Check(caller, {.action = Action::kCreate, .deed = "POST /task/new"});
    if (!may.ok()) return Refuse(exchange, may);
    absl::StatusOr<std::unique_ptr<FormAllowance>> allowance = Allow(caller, exchange.request);
    if (!allowance.ok()) return Refuse(exchange, allowance.status());
    auto files = std::make_shared<std::vector<std::pair<std::string, StagedFile>>>();
    auto incoming = std::make_shared<Incoming>(board_->staging_folder(), *std::move(allowance),
                                               [files](const std::string& name, StagedFile file) {
                                                 files->emplace_back(name, std::move(file));
                                                 return absl::OkStatus();
                                               });
    const std::string set_uuid = exchange.request.headers.Get("set-uuid");
    TakeForm(exchange, incoming, [this, caller, files, set_uuid](FormBody& form, HttpResponse& response) {
      const auto uuid = BeginWithFiles(caller, form, set_uuid, *files);
      if (!uuid.ok()) return AnswerError(response, ForGood(uuid.status()));
      Answer(response, {{"uuid", *uuid}});
    });
  }

  absl::StatusOr<std::string> BeginWithFiles(const Caller& caller, const FormBody& form, const std::string& set_uuid,
                                             std::vector<std::pair<std::string, StagedFile>>& files) {
    MW_ASSIGN_OR_RETURN(const NewOdmTask task, ParseNewTask(form, set_uuid));
    if (files.empty()) return absl::InvalidArgumentError("Need at least 1 file.");
    MW_ASSIGN_OR_RETURN(std::string uuid, board_->Begin(caller, task));
    absl::Status taken;
    for (auto& [name, file] : files) taken.Update(board_->TakeFile(uuid, name, *file));
    if (taken.ok()) taken = board_->Commit(uuid);
    if (taken.ok()) return uuid;
    board_->Remove(uuid).IgnoreError();
    return taken;
  }

  void Change(const Caller& caller, const std::string& what, HttpExchange& exchange) {
    TakeForm(exchange, nullptr, [this, caller, what](FormBody& form, HttpResponse& response) {
      const std::string uuid = form.Field("uuid").value_or("");
      const absl::Status may = CheckTask(caller, Action::kChange, "POST /task/" + what, uuid);
      if (absl::IsPermissionDenied(may)) return AnswerError(response, may);
      if (!may.ok()) return AnswerSuccess(response, may);
      if (what == "cancel") return AnswerSuccess(response, board_->Cancel(uuid));
      if (what == "remove") return AnswerSuccess(response, board_->Remove(uuid));
      AnswerSuccess(response, board_->Restart(uuid, form.Field("options")));
    });
  }

  const NodeOdmOptions options_;
  const NodeOdmServices services_;
  const OdmOptions task_options_;
  std::unique_ptr<TaskBoard> board_;
  std::unique_ptr<HttpServer> server_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<NodeOdmServer>> NodeOdmServer::Start(const NodeOdmOptions& options,
                                                                    const NodeOdmServices& services) {
  auto server = std::make_unique<RealNodeOdmServer>(options, services);
  MW_RETURN_IF_ERROR(server->Open());
  return server;
}

}  // namespace meshwright
