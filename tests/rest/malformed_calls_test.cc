// SPDX-License-Identifier: Apache-2.0
// Malformed calls over HTTP and gRPC: each gets its code and a message that names what is wrong, and the service goes
// on.

#include <cmath>
#include <functional>
#include <limits>

#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <grpcpp/grpcpp.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include "meshwright/v1/reconstruction.grpc.pb.h"
#include "meshwright/v1/worker.grpc.pb.h"

#include "common/base/clock.h"
#include "tests/rest/rest_cluster.h"

namespace meshwright {
namespace {

using testing::HasSubstr;

const std::string kSha = std::string(64, 'a');

class MalformedCallsTest : public RestCluster {
 protected:
  void SetUp() override {
    RestCluster::SetUp();
    ASSERT_EQ(PostJson("/v1/reconstructions", R"({"id":"there"})")->status, 200);
    ASSERT_EQ(PostJson("/v1/reconstructions", R"({"id":"over"})")->status, 200);
    ASSERT_EQ(http_->Post("/v1/reconstructions/over:cancel")->status, 200);
    channel_ =
        grpc::CreateChannel(absl::StrCat("127.0.0.1:", coordinator_->port()), grpc::InsecureChannelCredentials());
    public_ = v1::ReconstructionService::NewStub(channel_);
    workers_ = v1::WorkerService::NewStub(channel_);
  }
  void ExpectAlive() {
    EXPECT_EQ(http_->Get("/readyz")->status, 200);
    EXPECT_EQ(GetJson("/v1/reconstructions/there")["state"], "RECONSTRUCTION_STATE_CREATED");
  }

  // What the server answers to these very bytes until it closes the connection or says nothing for a second.
  std::string Raw(const std::string& request) {
    const int descriptor = ::socket(AF_INET, SOCK_STREAM, 0);
    sockaddr_in address = {};
    address.sin_family = AF_INET;
    address.sin_port = htons(static_cast<uint16_t>(coordinator_->rest_port()));
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    MW_CHECK(::connect(descriptor, reinterpret_cast<sockaddr*>(&address), sizeof(address)) == 0);
    const timeval timeout = {.tv_sec = 1, .tv_usec = 0};
    ::setsockopt(descriptor, SOL_SOCKET, SO_RCVTIMEO, &timeout, sizeof(timeout));
    EXPECT_EQ(::send(descriptor, request.data(), request.size(), MSG_NOSIGNAL), static_cast<ssize_t>(request.size()));
    std::string answer;
    char piece[4096];
    for (ssize_t got; (got = ::recv(descriptor, piece, sizeof(piece), 0)) > 0;) {
      answer.append(piece, static_cast<size_t>(got));
    }
    ::close(descriptor);
    return answer;
  }

  std::shared_ptr<grpc::Channel> channel_;
  std::unique_ptr<v1::ReconstructionService::Stub> public_;
  std::unique_ptr<v1::WorkerService::Stub> workers_;
};

TEST_F(MalformedCallsTest, OverHttp) {
  struct Case {
    const char* method;
    std::string path;
    std::string body;
    int status;
    std::string field;  // of the problem; "": none
    std::string detail;
    httplib::Headers headers = {};
  };
  const std::string all = "/v1/reconstructions";
  const std::string there = all + "/there";
  const std::string file = there + "/files/";
  const std::vector<Case> cases = {
      // Creating.
      {"POST", all, "", 415, "Content-Type", "application/json"},
      {"POST", all, "[]", 400, "", "JSON object"},
      {"POST", all, "{\"id\":", 400, "", "not valid JSON"},
      {"POST", all, "{}", 400, "id", "expected 1..64"},
      {"POST", all, R"({"id":"UPPER"})", 400, "id", "expected 1..64"},
      {"POST", all, R"({"id":"../../etc"})", 400, "id", "expected 1..64"},
      {"POST", all, R"({"id":5})", 400, "id", "expected"},
      {"POST", all, R"({"id":{"a":1}})", 400, "id", "expected"},
      {"POST", all, R"({"id":)" + std::string(100'000, '[') + std::string(100'000, ']') + "}", 400, "", "nested"},
      {"POST", all, R"({"id":"n","wait":1})", 400, "wait", "no field"},
      {"POST", all, R"({"id":"n","weight":-1})", 400, "weight", "expected 0..1000"},
      {"POST", all, R"({"id":"n","weight":"NaN"})", 400, "weight", "expected 0..1000"},
      {"POST", all, R"({"id":"n","weight":"much"})", 400, "weight", "expected"},
      {"POST", all, R"({"id":"n","optionsJson":"{"})", 400, "optionsJson", "not valid JSON"},
      {"POST", all, R"({"id":"n","optionsJson":"{\"windows\":1}"})", 400, "optionsJson", "windows"},
      {"POST", all, R"({"id":"n","optionsJson":"{\"window\":0}"})", 400, "optionsJson", "window"},
      {"POST", all, R"({"id":"n","optionsJson":"{\"window\":\"x\"}"})", 400, "optionsJson", "window"},
      {"POST", all, R"({"id":"n","sceneReference":"http://x/"})", 400, "sceneReference", "file:"},
      {"POST", all, R"({"id":"n","sceneReference":"file:../.."})", 400, "sceneReference", ".."},
      {"POST", all, R"({"id":"n","sceneReference":"file:none"})", 404, "sceneReference", "none"},
      {"POST", all, R"({"id":"there","weight":2})", 409, "id", "another reconstruction"},
      {"POST", all, std::string((1 << 20) + 1, ' '), 413, "", "1048576"},
      {"POST", all, "id=n", 415, "Content-Type", "application/json", {{"Content-Type", "text/plain"}}},
      {"POST", all, "{}", 415, "", "encoded", {{"Content-Encoding", "gzip"}, {"Content-Type", "application/json"}}},
      {"POST",
       all,
       "{}",
       403,
       "Origin",
       "another site",
       {{"Origin", "http://evil"}, {"Content-Type", "application/json"}}},
      // Listing and finding.
      {"GET", all + "?pageSize=x", "", 400, "pageSize", "expected a whole number"},
      {"GET", all + "?pageSize=1001", "", 400, "pageSize", "0..1000"},
      {"GET", all + "?pagesize=1", "", 400, "pagesize", "pageSize"},
      {"GET", all + "?pageSize=1&pageSize=2", "", 400, "pageSize", "twice"},
      {"GET", all + "/none", "", 404, "", "none"},
      {"GET", all + "/%00", "", 404, "", "no reconstruction"},
      {"DELETE", all + "/none", "", 404, "", "none"},
      {"POST", all + "/none:start", "", 404, "", "none"},
      {"POST", all + "/over:start", "", 409, "", "is cancelled"},
      {"POST", there + ":begin", "", 405, "", "expected DELETE, GET, HEAD"},
      {"PATCH", there, "{}", 405, "", "expected DELETE, GET, HEAD"},
      {"GET", "/v1/nothing", "", 404, "", "nothing at this path"},
      {"GET", "/v2.json", "", 404, "", "nothing at this path"},
      // Uploading.
      {"PUT", file + "a", "x", 400, "size", "missing"},
      {"PUT", file + "a?size=-1&sha256=" + kSha, "x", 400, "size", "0.."},
      {"PUT", file + "a?size=1", "x", 400, "sha256", "64 lower-case"},
      {"PUT", file + "a?size=1&sha256=AB", "x", 400, "sha256", "64 lower-case"},
      {"PUT", file + "a?size=1&sha256=" + kSha + "&partSha256=1", "x", 400, "partSha256", "64 lower-case"},
      {"PUT", file + "a?size=1&sha256=" + kSha, "x", 422, "sha256", "that of the bytes"},
      {"PUT", file + "a?size=2&sha256=" + kSha + "&partSha256=" + kSha, "x", 422, "partSha256", "that of the bytes"},
      {"PUT", file + "a?size=2&sha256=" + kSha, "x", 400, "partSha256", "missing"},
      {"PUT", file + "a?size=1&sha256=" + kSha, "xyz", 400, "size", "beyond"},
      {"PUT", file + "a?size=1&offset=2&sha256=" + kSha, "x", 400, "offset", "expected 0..1"},
      {"PUT", file + "b?size=9&offset=2&sha256=" + kSha, "x", 409, "offset", "expected 0"},
      {"PUT", file + "../x?size=1&sha256=" + kSha, "x", 400, "path", ".."},
      {"PUT", file + "%2Fetc?size=1&sha256=" + kSha, "x", 400, "path", ""},
      {"PUT", file + "a?length=1", "x", 400, "length", "size"},
      {"PUT", all + "/over/files/a?size=1&sha256=" + kSha, "x", 409, "", "is cancelled"},
      {"GET", file + "none", "", 404, "", "none"},
      // Looking.
      {"GET", there + "/events", "", 400, "Last-Event-ID", "id of an event", {{"Last-Event-ID", "x"}}},
      {"GET", there + "/events?lastEventId=-1", "", 400, "lastEventId", "0.."},
      {"GET", all + "/none/events", "", 404, "", "none"},
      {"GET", there + "/cameras/0/photo", "", 409, "", "scene has been checked"},
      {"GET", there + "/cameras/x/photo", "", 400, "camera", "whole number"},
      {"GET", there + "/cameras/0/photo?width=5", "", 400, "width", "16..2048"},
      {"GET", there + "/parts/0", "", 400, "sequence", "1.."},
      {"GET", there + "/parts/1", "", 404, "sequence", "no part"},
      {"GET", there + "/parts/1/preview?max_faces=0", "", 400, "max_faces", "1.."},
      {"GET", there + "/mesh", "", 409, "", "one that is done"},
      {"GET", there + "/mesh?partial=yes", "", 400, "partial", "true or false"},
      {"GET", there + "/mesh?format=docx", "", 400, "format", "ply, glb"},
      {"GET", there + "/mesh?format=obj&texture=true", "", 400, "texture", "format=glb"},
      {"GET", there + "/mesh?texture=true", "", 400, "texture", "format=glb"},
      {"GET", there + "/mesh.glb", "", 409, "", "one that is done"},
      {"GET", there + "/tiles/tileset.json", "", 409, "", "one that is done"},
      {"GET", all + "/none/tiles/tileset.json", "", 404, "", "none"},
  };
  for (const Case& c : cases) {
    httplib::Request request;
    request.method = c.method;
    request.path = c.path;
    request.body = c.body;
    request.headers = c.headers;
    if (c.headers.count("Content-Type") == 0 && !c.body.empty()) request.set_header("Content-Type", "application/json");
    const auto result = http_->send(request);
    const std::string name = absl::StrCat(c.method, " ", c.path, " ", c.body.substr(0, 60));
    ASSERT_TRUE(result) << name;
    EXPECT_EQ(result->status, c.status) << name << "\n" << result->body;
    EXPECT_EQ(result->get_header_value("Content-Type"), "application/problem+json") << name;
    const Json problem = Json::parse(result->body, nullptr, false);
    ASSERT_TRUE(problem.is_object()) << name << "\n" << result->body;
    EXPECT_EQ(problem["status"], c.status) << name;
    EXPECT_EQ(problem.value("field", ""), c.field) << name << "\n" << result->body;
    EXPECT_THAT(problem.value("detail", ""), HasSubstr(c.detail)) << name;
    EXPECT_FALSE(problem.value("code", "").empty()) << name;
  }
  ExpectAlive();
}

// What no HTTP library would send.
TEST_F(MalformedCallsTest, OverHttpByteByByte) {
  const std::string host = "Host: x\r\n";
  const auto post = [&](const std::string& headers, const std::string& body) {
    return Raw("POST /v1/reconstructions HTTP/1.1\r\n" + host + "Content-Type: application/json\r\n" + headers +
               "Connection: close\r\n\r\n" + body);
  };
  EXPECT_THAT(Raw("HELLO\r\n\r\n"), HasSubstr(" 400 "));
  EXPECT_THAT(Raw("BREW /v1/workers HTTP/1.1\r\n" + host + "\r\n"), HasSubstr(" 400 "));
  EXPECT_THAT(Raw("GET /" + std::string(9000, 'a') + " HTTP/1.1\r\n" + host + "\r\n"), HasSubstr(" 414 "));
  EXPECT_THAT(post("Content-Length: 999999999999\r\n", "{}"), HasSubstr(" 413 "));
  EXPECT_THAT(post("Content-Length: -5\r\n", "{}"), HasSubstr("\"field\":\"Content-Length\""));
  EXPECT_THAT(post("Transfer-Encoding: chunked\r\n", "zz\r\n{}\r\n0\r\n\r\n"), HasSubstr(" 400 "));
  EXPECT_THAT(post("Transfer-Encoding: chunked\r\n", "2\r\n{}\r\n0\r\n\r\n"), HasSubstr("\"field\":\"id\""));
  EXPECT_THAT(post("", ""), HasSubstr("not valid JSON"));
  EXPECT_THAT(Raw("POST /v1/reconstructions HTTP/1.1\r\n" + host +
                  "Content-Type: multipart/form-data; boundary=b\r\nContent-Length: 5\r\n\r\n--b--"),
              HasSubstr(" 415 "));
  // A body with GET is not taken for the next request.
  const std::string smuggled = "DELETE /v1/reconstructions/there HTTP/1.1\r\n" + host + "\r\n";
  const std::string answer =
      Raw(absl::StrCat("GET /healthz HTTP/1.1\r\n", host, "Content-Length: ", smuggled.size(), "\r\n\r\n", smuggled));
  EXPECT_THAT(answer, HasSubstr(" 400 "));
  EXPECT_THAT(answer, HasSubstr("Connection: close"));
  EXPECT_THAT(Raw("GET /v1/workers HTTP/1.1\r\n" + host + "Range: bytes=9-1\r\n\r\n"),
              testing::Not(testing::IsEmpty()));
  ExpectAlive();
}

TEST_F(MalformedCallsTest, OverGrpc) {
  struct Case {
    const char* name;
    std::function<grpc::Status(grpc::ClientContext*)> call;
    grpc::StatusCode code;
    std::string message;
  };
  const auto create = [&](const std::function<void(v1::CreateReconstructionRequest&)>& change) {
    return [this, change](grpc::ClientContext* context) {
      v1::CreateReconstructionRequest request;
      request.set_id("n");
      change(request);
      v1::CreateReconstructionResponse response;
      return public_->CreateReconstruction(context, request, &response);
    };
  };
  const auto upload = [&](const std::vector<v1::UploadSceneFileRequest>& messages) {
    return [this, messages](grpc::ClientContext* context) {
      v1::UploadSceneFileResponse response;
      const auto writer = public_->UploadSceneFile(context, &response);
      for (const auto& message : messages) {
        if (!writer->Write(message)) break;
      }
      writer->WritesDone();
      return writer->Finish();
    };
  };
  const auto header = [](const std::string& id, const std::string& path, int64_t size, const std::string& sha256) {
    v1::UploadSceneFileRequest message;
    message.mutable_header()->set_reconstruction_id(id);
    message.mutable_header()->set_path(path);
    message.mutable_header()->set_size_bytes(size);
    message.mutable_header()->set_sha256(sha256);
    return message;
  };
  v1::UploadSceneFileRequest chunk;
  chunk.set_chunk("xyz");
  const auto synchronize = [&](const std::function<void(v1::SynchronizeRequest&)>& change) {
    return [this, change](grpc::ClientContext* context) {
      v1::SynchronizeRequest request;
      request.set_worker_id("w");
      request.set_instance("i");
      request.set_cores(1);
      request.set_memory_bytes(1);
      change(request);
      v1::SynchronizeResponse response;
      return workers_->Synchronize(context, request, &response);
    };
  };
  const auto get = [&](const std::string& id) {
    return [this, id](grpc::ClientContext* context) {
      v1::GetReconstructionRequest request;
      request.set_id(id);
      v1::GetReconstructionResponse response;
      return public_->GetReconstruction(context, request, &response);
    };
  };
  const auto list = [&](int page_size) {
    return [this, page_size](grpc::ClientContext* context) {
      v1::ListReconstructionsRequest request;
      request.set_page_size(page_size);
      v1::ListReconstructionsResponse response;
      return public_->ListReconstructions(context, request, &response);
    };
  };
  const auto put_blob = [&](const std::string& digest) {
    return [this, digest](grpc::ClientContext* context) {
      v1::PutBlobResponse response;
      const auto writer = workers_->PutBlob(context, &response);
      v1::PutBlobRequest request;
      if (digest.empty()) {
        request.set_chunk("bytes");
      } else {
        request.set_digest(digest);
      }
      writer->Write(request);
      request.set_chunk("bytes");
      writer->Write(request);
      writer->WritesDone();
      return writer->Finish();
    };
  };
  constexpr auto kInvalid = grpc::StatusCode::INVALID_ARGUMENT;
  const std::vector<Case> cases = {
      {"no id", create([](auto& r) { r.set_id(""); }), kInvalid, "id"},
      {"an id with blanks", create([](auto& r) { r.set_id("a b"); }), kInvalid, "id"},
      {"a long id", create([](auto& r) { r.set_id(std::string(65, 'a')); }), kInvalid, "id"},
      {"options that are no object", create([](auto& r) { r.set_options_json("3"); }), kInvalid, "options_json"},
      {"an option that is not there", create([](auto& r) { r.set_options_json("{\"x\":1}"); }), kInvalid, "\"x\""},
      {"an option of another type", create([](auto& r) { r.set_options_json("{\"window\":1.5}"); }), kInvalid,
       "window"},
      {"a weight that is no number", create([](auto& r) { r.set_weight(std::numeric_limits<double>::quiet_NaN()); }),
       kInvalid, "weight"},
      {"an infinite weight", create([](auto& r) { r.set_weight(std::numeric_limits<double>::infinity()); }), kInvalid,
       "weight"},
      {"a scene out of the roots", create([](auto& r) { r.set_scene_reference("file:/etc"); }), kInvalid,
       "scene_reference"},
      {"an id that is taken", create([](auto& r) {
         r.set_id("there");
         r.set_weight(7);
       }),
       grpc::StatusCode::ALREADY_EXISTS, "there"},
      {"nobody's id", get("none"), grpc::StatusCode::NOT_FOUND, "none"},
      {"a page of negative size", list(-1), kInvalid, "page_size"},
      {"a page that is too large", list(1001), kInvalid, "page_size"},
      {"an upload without a header", upload({chunk}), kInvalid, "header"},
      {"an upload of nothing", upload({}), kInvalid, "header"},
      {"two headers", upload({header("there", "a", 3, kSha), header("there", "a", 3, kSha)}), kInvalid, "chunk"},
      {"a path that leads out", upload({header("there", "../a", 3, kSha)}), kInvalid, "path"},
      {"an absolute path", upload({header("there", "/a", 3, kSha)}), kInvalid, "path"},
      {"a negative size", upload({header("there", "a", -3, kSha)}), kInvalid, "size_bytes"},
      {"a digest that is none", upload({header("there", "a", 3, "x")}), kInvalid, "sha256"},
      {"another digest", upload({header("there", "a", 3, kSha), chunk}), kInvalid, "sha256"},
      {"too few bytes", upload({header("there", "a", 5, kSha), chunk}), kInvalid, "size_bytes"},
      {"too many bytes", upload({header("there", "a", 1, kSha), chunk}), kInvalid, "size_bytes"},
      {"an upload to what is over", upload({header("over", "a", 3, kSha)}), grpc::StatusCode::FAILED_PRECONDITION,
       "is cancelled"},
      {"an upload to nobody", upload({header("none", "a", 3, kSha)}), grpc::StatusCode::NOT_FOUND, "none"},
      {"a worker without a name", synchronize([](auto& r) { r.set_worker_id(""); }), kInvalid, "worker_id"},
      {"a worker without an instance", synchronize([](auto& r) { r.set_instance(""); }), kInvalid, "instance"},
      {"a worker without cores", synchronize([](auto& r) { r.set_cores(0); }), kInvalid, "cores"},
      {"a worker without memory", synchronize([](auto& r) { r.set_memory_bytes(-5); }), kInvalid, "memory_bytes"},
      {"endless wait timeout",
       synchronize([](auto& r) { r.set_wait_timeout_seconds(std::numeric_limits<double>::infinity()); }), kInvalid,
       "wait_timeout_seconds"},
      {"a blob without a digest", put_blob(""), kInvalid, "digest"},
      {"a blob with another digest", put_blob(kSha), kInvalid, "digest"},
      {"a blob whose digest is a path", put_blob("../../../etc/passwd"), kInvalid, "digest"},
  };
  for (const Case& c : cases) {
    grpc::ClientContext context;
    context.set_deadline(absl::ToChronoTime(SystemClock().Now() + absl::Seconds(20)));
    const grpc::Status status = c.call(&context);
    EXPECT_EQ(status.error_code(), c.code) << c.name << ": " << status.error_message();
    EXPECT_THAT(status.error_message(), HasSubstr(c.message)) << c.name;
  }
  ExpectAlive();
}

}  // namespace
}  // namespace meshwright
