// SPDX-License-Identifier: Apache-2.0
// The REST interface over real connections: a scene uploaded in parts, followed, looked at and downloaded.

#include <map>
#include <set>
#include <sstream>

#include <gmock/gmock.h>

#include "common/base/method_version.h"
#include "common/mesh/ply.h"
#include "tests/rest/rest_cluster.h"
#include "worker/agent/grpc_coordinator.h"

namespace meshwright {
namespace {

using testing::HasSubstr;
using testing::StartsWith;

class RestTest : public RestCluster {
 protected:
  // All events until the stream ends, as (name, id, data).
  struct Event {
    std::string name;
    std::string id;
    Json data;
  };
  std::vector<Event> ReadEvents(const std::string& id, const httplib::Headers& headers = {}) {
    httplib::Client client("127.0.0.1", coordinator_->rest_port());
    client.set_read_timeout(60);
    std::string text;
    const auto result = client.Get("/v1/reconstructions/" + id + "/events", headers, [&](const char* bytes, size_t n) {
      text.append(bytes, n);
      return true;
    });
    EXPECT_TRUE(result) << "the stream did not end well";
    std::vector<Event> events;
    std::istringstream lines(text);
    Event event;
    for (std::string line; std::getline(lines, line);) {
      if (line.rfind("id: ", 0) == 0) event.id = line.substr(4);
      if (line.rfind("event: ", 0) == 0) event.name = line.substr(7);
      if (line.rfind("data: ", 0) == 0) event.data = Json::parse(line.substr(6), nullptr, false);
      if (line.empty() && !event.name.empty()) events.push_back(std::exchange(event, {}));
    }
    return events;
  }
  void Create(const std::string& id, const std::string& options = "{}") {
    const auto created = PostJson("/v1/reconstructions", Json{{"id", id}, {"optionsJson", options}}.dump());
    ASSERT_TRUE(created && created->status == 200) << (created ? created->body : "");
  }
};

TEST_F(RestTest, FromAnInterruptedUploadToTheMesh) {
  const std::string base = "/v1/reconstructions/c7";
  Create("c7");
  Create("c7");  // idempotent
  EXPECT_EQ(PostJson("/v1/reconstructions", R"({"id":"c7","weight":3})")->status, 409);

  // The first file in three parts. The coordinator goes down after the second one, which is then sent again.
  const auto& [path, content] = SceneFiles().front();
  const size_t third = content.size() / 3;
  ASSERT_EQ(PutPart("c7", path, content, 0, third)->status, 200);
  const auto skipped = PutPart("c7", path, content, 2 * third, content.size());
  EXPECT_EQ(skipped->status, 409);
  EXPECT_EQ(skipped->get_header_value("Upload-Offset"), std::to_string(third));
  ASSERT_EQ(PutPart("c7", path, content, third, third)->status, 200);
  Stop();
  Start();
  EXPECT_EQ(http_->Head(base + "/files/" + path)->get_header_value("Upload-Offset"), std::to_string(2 * third));
  const auto repeated = PutPart("c7", path, content, third, third);
  EXPECT_EQ(repeated->status, 200) << repeated->body;
  EXPECT_EQ(repeated->get_header_value("Upload-Offset"), std::to_string(2 * third));
  std::string damaged = content;
  damaged[third] = static_cast<char>(damaged[third] + 1);
  EXPECT_EQ(http_
                ->Put(absl::StrCat(base, "/files/", path, "?size=", content.size(), "&sha256=", Sha256Hex(content),
                                   "&offset=", third, "&partSha256=", Sha256Hex(damaged.substr(third, third))),
                      damaged.substr(third, third), "application/octet-stream")
                ->status,
            409);
  const auto last = PutPart("c7", path, content, 2 * third, content.size());
  ASSERT_EQ(last->status, 200) << last->body;
  EXPECT_TRUE(Json::parse(last->body)["complete"].get<bool>());
  UploadScene("c7");  // the first file once more, and the others
  EXPECT_EQ(GetJson(base + "/files")["files"].size(), SceneFiles().size());

  EXPECT_EQ(http_->Get(base + "/mesh")->status, 409);
  EXPECT_EQ(http_->Post(base + ":start")->status, 200);
  EXPECT_EQ(http_->Post(base + ":start")->status, 200);
  StartWorker();
  const std::vector<Event> events = ReadEvents("c7");

  // Parts come once each, in order; states in between; the end at the end.
  ASSERT_GE(events.size(), 3U);
  EXPECT_EQ(events.front().name, "reconstruction");
  EXPECT_EQ(events.back().name, "end");
  std::vector<Json> parts;
  Json last_state;
  for (const Event& event : events) {
    if (event.name == "reconstruction") last_state = event.data["state"];
    if (event.name != "part") continue;
    EXPECT_EQ(event.id, std::to_string(event.data["sequence"].get<int>()));
    if (!parts.empty()) {
      EXPECT_GT(event.data["sequence"].get<int>(), parts.back()["sequence"].get<int>());
    }
    parts.push_back(event.data);
  }
  EXPECT_EQ(last_state, "RECONSTRUCTION_STATE_DONE");
  ASSERT_FALSE(parts.empty());
  EXPECT_EQ(GetJson(base + "/parts")["parts"], Json(parts));
  // Who knows them is not told again.
  const std::vector<Event> rest = ReadEvents("c7", {{"Last-Event-ID", events.back().id}});
  ASSERT_EQ(rest.size(), 2U);
  EXPECT_EQ(rest[0].name, "reconstruction");
  EXPECT_EQ(rest[1].name, "end");

  // The mesh, whole and in ranges.
  const Json reconstruction = GetJson(base);
  const std::string etag = "\"" + reconstruction["meshSha256"].get<std::string>() + "\"";
  const auto mesh = http_->Get(base + "/mesh");
  ASSERT_EQ(mesh->status, 200);
  EXPECT_EQ(Sha256Hex(mesh->body), reconstruction["meshSha256"]);
  EXPECT_EQ(mesh->get_header_value("ETag"), etag);
  EXPECT_EQ(mesh->get_header_value("Content-Type"), "model/ply");
  const auto middle = http_->Get(base + "/mesh", {{"Range", "bytes=100-199"}, {"If-Range", etag}});
  EXPECT_EQ(middle->status, 206);
  EXPECT_EQ(middle->body, mesh->body.substr(100, 100));
  EXPECT_EQ(middle->get_header_value("Content-Range"), absl::StrCat("bytes 100-199/", mesh->body.size()));
  EXPECT_EQ(http_->Get(base + "/mesh", {{"Range", "bytes=-50"}})->body, mesh->body.substr(mesh->body.size() - 50));
  EXPECT_EQ(http_->Get(base + "/mesh", {{"Range", "bytes=5-9"}, {"If-Range", "\"old\""}})->status, 200);
  EXPECT_EQ(http_->Get(base + "/mesh", {{"If-None-Match", etag}})->status, 304);
  const auto beyond = http_->Get(base + "/mesh", {{"Range", absl::StrCat("bytes=", mesh->body.size(), "-")}});
  EXPECT_EQ(beyond->status, 416);
  EXPECT_EQ(beyond->get_header_value("Content-Range"), absl::StrCat("bytes */", mesh->body.size()));
  const auto head = http_->Head(base + "/mesh");
  EXPECT_EQ(head->get_header_value("Content-Length"), std::to_string(mesh->body.size()));
  EXPECT_THAT(http_->Get(base + "/mesh.glb")->body, StartsWith("glTF"));
  const auto textured = http_->Get(base + "/mesh?format=glb&texture=true");
  ASSERT_TRUE(textured && textured->status == 200) << (textured ? textured->body : "");
  EXPECT_EQ(textured->body.substr(0, 4), "glTF");
  EXPECT_NE(textured->body.find("TEXCOORD_0"), std::string::npos);
  const Json formats = GetJson("/v1/formats")["formats"];
  ASSERT_GE(formats.size(), 5U);
  for (const Json& format : formats) {
    const auto converted = http_->Get(base + "/mesh?format=" + format["name"].get<std::string>());
    EXPECT_EQ(converted->status, 200) << format;
    EXPECT_EQ(converted->get_header_value("Content-Type"), format["mediaType"]);
    EXPECT_EQ(converted->body == mesh->body, format["name"] == "ply");
  }

  // What it came to.
  const Json verdict = GetJson(base)["verdict"];
  EXPECT_GT(verdict["coverage"].get<double>(), 0.3) << verdict;
  EXPECT_THAT(verdict["summary"].get<std::string>(), HasSubstr("of the photographs covered"));

  // Levels of detail: what tileset.json names is there, and nothing else.
  const auto tileset = http_->Get(base + "/tiles/tileset.json");
  ASSERT_TRUE(tileset && tileset->status == 200) << (tileset ? tileset->body : "");
  EXPECT_EQ(tileset->get_header_value("Content-Type"), "application/json");
  const std::string root = Json::parse(tileset->body)["root"]["content"]["uri"];
  const auto tile = http_->Get(base + "/tiles/" + root);
  EXPECT_EQ(tile->get_header_value("Content-Type"), "model/gltf-binary");
  EXPECT_THAT(tile->body, StartsWith("glTF"));
  const std::string tile_etag = tile->get_header_value("ETag");
  EXPECT_EQ(http_->Get(base + "/tiles/" + root, {{"If-None-Match", tile_etag}})->status, 304);
  EXPECT_EQ(http_->Get(base + "/tiles/tileset.tiles/r999.glb")->status, 404);
  for (const char* outside : {"/tiles/..%2Ftileset.json", "/tiles/%2Fetc%2Fpasswd", "/tiles/"}) {
    EXPECT_EQ(http_->Get(base + outside)->status, 400) << outside;
  }

  // Again with other options, of the same files.
  const auto again = PostJson(base + ":again", R"({"id":"c8","optionsJson":"{\"lattice-step\":4}"})");
  ASSERT_EQ(again->status, 200) << again->body;
  EXPECT_EQ(Json::parse(again->body)["state"], "RECONSTRUCTION_STATE_CREATED");
  EXPECT_EQ(GetJson("/v1/reconstructions/c8/files")["files"].size(), SceneFiles().size());
  EXPECT_EQ(PostJson("/v1/reconstructions/nowhere:again", R"({"id":"c9"})")->status, 404);
  EXPECT_EQ(PostJson(base + ":again", R"({"id":"c9","sceneReference":"file:x"})")->status, 400);

  // One part: as PLY with all of its faces, and as a preview with few.
  const std::string part = absl::StrCat(base, "/parts/", parts[0]["sequence"].get<int>());
  const auto ply = ParsePly(http_->Get(part)->body, "part");
  ASSERT_TRUE(ply.ok()) << ply.status();
  EXPECT_FALSE(ply->faces.empty());
  const auto surface = http_->Get(part + "/surface");
  EXPECT_EQ(Sha256Hex(surface->body), parts[0]["sha256"]);
  const auto preview = http_->Get(part + "/preview?max_faces=50");
  EXPECT_THAT(preview->body, StartsWith("MWPV"));
  EXPECT_LE(preview->body[20], 50);
  EXPECT_EQ(http_->Get(part + "/preview?max_faces=50", {{"If-None-Match", preview->get_header_value("ETag")}})->status,
            304);

  const Json cameras = GetJson(base + "/cameras")["cameras"];
  ASSERT_EQ(cameras.size(), 5U);
  for (const Json& camera : cameras) {
    EXPECT_EQ(camera["geometry"]["rotation"].size(), 9U);
    EXPECT_EQ(camera["geometry"]["width"], 160);
    EXPECT_EQ(camera["attempts"], 1);
    EXPECT_EQ(camera["worker"], "w");
    EXPECT_GT(camera["shares"]["grown"].get<double>() + camera["shares"]["coveredBefore"].get<double>(), 0);
  }
  const auto photo = http_->Get(base + "/cameras/0/photo?width=40");
  EXPECT_EQ(photo->get_header_value("Content-Type"), "image/jpeg");
  EXPECT_THAT(photo->body, StartsWith("\xff\xd8"));
  const Json entries = GetJson(base + "/log")["entries"];
  ASSERT_EQ(entries.size(), 2U);  // nothing went wrong
  EXPECT_EQ(entries[0]["message"], "created");
  EXPECT_EQ(entries[1]["message"], "done");

  // Every camera was handed out once, after the refinement of all (of camera -1), and its job came to a good end.
  const Json attempts = GetJson(base + "/attempts")["attempts"];
  ASSERT_EQ(attempts.size(), 6U);
  std::set<int> attempted;
  for (const Json& attempt : attempts) {
    attempted.insert(attempt["camera"].get<int>());
    EXPECT_EQ(attempt["worker"], "w");
    EXPECT_EQ(attempt["ending"], "ATTEMPT_ENDING_FINISHED");
    EXPECT_LE(attempt["beginTime"].get<std::string>(), attempt["endTime"].get<std::string>());
  }
  EXPECT_EQ(attempted.size(), 6U);
  EXPECT_EQ(*attempted.begin(), -1);
  EXPECT_EQ(GetJson(base + "/attempts?maxAttempts=2")["attempts"].size(), 2U);
  EXPECT_EQ(http_->Get(base + "/attempts?maxAttempts=-1")->status, 400);
  const Json later = GetJson(absl::StrCat(base, "/parts?after=", parts.front()["sequence"].get<int>()))["parts"];
  EXPECT_EQ(later, Json(std::vector<Json>(parts.begin() + 1, parts.end())));

  EXPECT_EQ(http_->Delete(base)->status, 204);
  EXPECT_EQ(http_->Get(base)->status, 404);
}

TEST_F(RestTest, TheMeshSoFarWhileItRuns) {
  const std::string base = "/v1/reconstructions/early";
  Create("early");
  UploadScene("early");
  ASSERT_EQ(http_->Post(base + ":start")->status, 200);
  // Nobody works: no part has been accepted.
  const auto none = http_->Get(base + "/mesh?partial=true");
  ASSERT_EQ(none->status, 200) << none->body;
  EXPECT_TRUE(ParsePly(none->body, "mesh")->faces.empty());
  StartWorker();
  std::set<size_t> faces;
  while (GetJson(base)["state"] != "RECONSTRUCTION_STATE_DONE") {
    const auto partial = http_->Get(base + "/mesh?partial=true");
    ASSERT_EQ(partial->status, 200) << partial->body;
    const auto mesh = ParsePly(partial->body, "mesh");
    ASSERT_TRUE(mesh.ok()) << mesh.status();
    faces.insert(mesh->faces.size());
  }
  EXPECT_GE(faces.size(), 1U);
  EXPECT_EQ(Sha256Hex(http_->Get(base + "/mesh?partial=true")->body), GetJson(base)["meshSha256"]);
}

// Names of files are bytes, JSON and Protocol Buffers are not.
TEST_F(RestTest, NamesThatAreNoTextEndNothing) {
  const std::string scene = folder_ + "/scenes/a";
  for (const auto& [path, content] : SceneFiles()) {
    std::string name = path;
    std::string bytes = content;
    if (path == "images/0004.png") name = "images/0004\xE9.png";
    if (path == "model/images.txt") bytes.replace(bytes.find("0004.png"), 8, "0004\xE9.png");
    std::filesystem::create_directories(std::filesystem::path(scene + "/" + name).parent_path());
    ASSERT_TRUE(WriteFileAtomically(scene + "/" + name, bytes).ok());
  }
  const std::string base = "/v1/reconstructions/bytes";
  ASSERT_EQ(PostJson("/v1/reconstructions", R"({"id":"bytes","sceneReference":"file:a"})")->status, 200);
  ASSERT_EQ(http_->Post(base + ":start")->status, 200);
  StartWorker();
  while (GetJson(base)["state"] != "RECONSTRUCTION_STATE_DONE") {
    ASSERT_NE(GetJson(base)["state"], "RECONSTRUCTION_STATE_FAILED");
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
  EXPECT_EQ(GetJson(base + "/cameras")["cameras"][4]["name"], "0004%E9.png");
  for (const Event& event : ReadEvents("bytes")) EXPECT_FALSE(event.data.is_discarded()) << event.name;

  Create("put");
  const auto put = PutPart("put", "images/a%E9.png", "bytes", 0, 5);
  EXPECT_EQ(put->status, 400);
  EXPECT_THAT(put->body, HasSubstr("UTF-8"));
}

TEST_F(RestTest, ADrainedWorkerGetsNothing) {
  EXPECT_EQ(http_->Post("/v1/workers/w:drain")->status, 404);
  StartWorker();
  while (GetJson("/v1/workers")["workers"].empty()) std::this_thread::sleep_for(std::chrono::milliseconds(20));
  EXPECT_EQ(http_->Post("/v1/workers/w:drain")->status, 204);
  EXPECT_EQ(http_->Post("/v1/workers/w:drain")->status, 204);
  Create("waits");
  UploadScene("waits");
  ASSERT_EQ(http_->Post("/v1/reconstructions/waits:start")->status, 200);
  // Nothing is handed out, and its owner is told.
  Json waits;
  do {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
    waits = GetJson("/v1/reconstructions/waits");
  } while (waits["warnings"].empty());
  EXPECT_THAT(waits["warnings"][0].get<std::string>(), HasSubstr("no worker"));
  EXPECT_TRUE(GetJson("/v1/reconstructions/waits/attempts")["attempts"].empty());
  const Json worker = GetJson("/v1/workers")["workers"][0];
  EXPECT_TRUE(worker["draining"].get<bool>());
  EXPECT_EQ(worker["jobs"], 0);
}

// Cameras that cannot be read fail; why is in the log, and who tried.
TEST_F(RestTest, TheLogSaysWhatFailedAndWhy) {
  Create("poor", R"({"refine-cameras": 0})");
  UploadScene("poor");
  ASSERT_EQ(http_->Post("/v1/reconstructions/poor:start")->status, 200);
  while (GetJson("/v1/reconstructions/poor")["progress"]["camerasTotal"] == 0) {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  const auto channel = GrpcCoordinator::Connect(absl::StrCat("127.0.0.1:", coordinator_->port()));
  v1::SynchronizeRequest request;
  request.set_worker_id("clumsy");
  request.set_instance("1");
  request.set_cores(1);
  request.set_memory_bytes(int64_t{1} << 40);
  request.set_method_version(kMethodVersion);
  request.set_wait_timeout_seconds(1);
  const auto first = channel->Synchronize(request);
  ASSERT_TRUE(first.ok()) << first.status();
  ASSERT_EQ(first->jobs_size(), 1);
  // What it does now is seen.
  const Json running = GetJson("/v1/workers")["workers"][0]["running"];
  ASSERT_EQ(running.size(), 1U);
  EXPECT_EQ(running[0]["reconstructionId"], "poor");
  EXPECT_EQ(running[0]["camera"], first->jobs(0).camera());
  EXPECT_EQ(running[0]["ending"], "ATTEMPT_ENDING_UNSPECIFIED");
  EXPECT_FALSE(running[0].contains("endTime"));
  EXPECT_EQ(GetJson("/v1/reconstructions/poor/attempts")["attempts"], running);

  request.set_draining(true);
  *request.add_held()->mutable_key() = first->jobs(0).key();
  request.mutable_held(0)->mutable_failed()->set_reason("dropped it");
  ASSERT_TRUE(channel->Synchronize(request).ok());
  const Json attempts = GetJson("/v1/reconstructions/poor/attempts")["attempts"];
  ASSERT_EQ(attempts.size(), 1U);
  EXPECT_EQ(attempts[0]["ending"], "ATTEMPT_ENDING_FAILED");
  const Json entries = GetJson("/v1/reconstructions/poor/log")["entries"];
  ASSERT_EQ(entries.size(), 2U);
  EXPECT_EQ(entries[1]["severity"], "warning");
  EXPECT_EQ(entries[1]["worker"], "clumsy");
  EXPECT_EQ(entries[1]["camera"], first->jobs(0).camera());
  EXPECT_THAT(entries[1]["message"].get<std::string>(), HasSubstr("failed: dropped it"));
  EXPECT_EQ(entries[1]["time"].get<std::string>().substr(0, 19),
            attempts[0]["endTime"].get<std::string>().substr(0, 19));
  const Json camera = GetJson("/v1/reconstructions/poor/cameras")["cameras"][first->jobs(0).camera()];
  EXPECT_EQ(camera["attempts"], 1);
  EXPECT_EQ(camera["failedAttempts"], 1);
  EXPECT_EQ(camera["lastFailure"], "dropped it");
  EXPECT_EQ(camera["worker"], "clumsy");
}

TEST_F(RestTest, ListsInPages) {
  for (const char* id : {"a", "b", "c"}) Create(id);
  const Json first = GetJson("/v1/reconstructions?pageSize=2");
  EXPECT_EQ(first["reconstructions"].size(), 2U);
  const Json second = GetJson("/v1/reconstructions?pageToken=" + first["nextPageToken"].get<std::string>());
  ASSERT_EQ(second["reconstructions"].size(), 1U);
  EXPECT_EQ(second["reconstructions"][0]["id"], "c");
  EXPECT_EQ(second["nextPageToken"], "");
}

TEST_F(RestTest, ADigestThatIsWrongMeansAllOfTheFileAgain) {
  Create("d");
  const std::string wrong(64, 'a');
  const std::string file = "/v1/reconstructions/d/files/x.bin?size=6&sha256=";
  const auto put = [&](const std::string& sha256, int offset, const std::string& part) {
    return http_->Put(absl::StrCat(file, sha256, "&offset=", offset, "&partSha256=", Sha256Hex(part)), part,
                      "application/octet-stream");
  };
  EXPECT_EQ(put(wrong, 0, "abc")->status, 200);
  const auto refused = put(wrong, 3, "def");
  EXPECT_EQ(refused->status, 422);
  EXPECT_EQ(Json::parse(refused->body)["field"], "sha256");
  EXPECT_EQ(refused->get_header_value("Upload-Offset"), "0");
  EXPECT_EQ(put(Sha256Hex(std::string("abcdef")), 0, "abc")->status, 200);
  EXPECT_EQ(put(Sha256Hex(std::string("abcdef")), 3, "def")->status, 200);
}

// Bytes that this process has read from and written to files so far; sockets do not count.
std::pair<int64_t, int64_t> FileBytes() {
  std::istringstream lines(*ReadFile("/proc/self/io"));
  std::map<std::string, int64_t> counts;
  std::string name;
  int64_t count = 0;
  while (lines >> name >> count) counts[name] = count;
  return {counts["rchar:"], counts["wchar:"]};
}

TEST_F(RestTest, AByteIsWrittenOnceAndNotReadAgain) {
  Create("once");
  constexpr size_t kBytes = 24 << 20;
  std::string content(kBytes, '\0');
  for (size_t i = 0; i < kBytes; i += 7) content[i] = static_cast<char>(i);
  const auto [read, written] = FileBytes();
  ASSERT_EQ(PutPart("once", "whole.bin", content, 0, kBytes)->status, 200);
  const auto [read_whole, written_whole] = FileBytes();
  EXPECT_LT(read_whole - read, kBytes / 10);
  EXPECT_LT(written_whole - written, kBytes + kBytes / 10);
  EXPECT_GE(written_whole - written, kBytes);
  content[0] = 'x';
  for (size_t third = 0; third < 3; ++third) {
    ASSERT_EQ(PutPart("once", "parts.bin", content, third * kBytes / 3, kBytes / 3)->status, 200);
  }
  const auto [read_parts, written_parts] = FileBytes();
  EXPECT_LT(read_parts - read_whole, kBytes / 10);
  EXPECT_LT(written_parts - written_whole, kBytes + kBytes / 10);
  EXPECT_EQ(GetJson("/v1/reconstructions/once/files")["files"].size(), 2U);
}

TEST_F(RestTest, AnUploadWhoseBytesAreGoneBeginsAnew) {
  Create("gone");
  const std::string content = "a wall of bytes";
  ASSERT_EQ(PutPart("gone", "x.bin", content, 0, 6)->status, 200);
  std::filesystem::remove_all(folder_ + "/data/blobs/staging");
  const auto lost = PutPart("gone", "x.bin", content, 6, 9);
  EXPECT_EQ(lost->status, 409);
  EXPECT_EQ(lost->get_header_value("Upload-Offset"), "0");
  EXPECT_EQ(PutPart("gone", "x.bin", content, 0, 6)->status, 200);
  const auto last = PutPart("gone", "x.bin", content, 6, 9);
  EXPECT_EQ(last->status, 200);
  EXPECT_TRUE(Json::parse(last->body)["complete"].get<bool>());
  EXPECT_TRUE(std::filesystem::is_empty(folder_ + "/data/blobs/staging"));
}

TEST_F(RestTest, ATokenIsAskedForWhenThereIsOne) {
  Stop();
  const std::string token = "0123456789abcdef";
  ASSERT_TRUE(WriteFileAtomically(folder_ + "/token", token + "\n").ok());
  settings_.api_token_file = folder_ + "/token";
  Start();
  EXPECT_EQ(http_->Get("/healthz")->status, 200);
  const auto without = http_->Get("/v1/workers");
  EXPECT_EQ(without->status, 401);
  EXPECT_EQ(without->get_header_value("WWW-Authenticate"), "Bearer");
  EXPECT_EQ(http_->Get("/v1/workers", {{"Authorization", "Bearer 0123456789abcdeX"}})->status, 401);
  EXPECT_EQ(http_->Get("/v1/workers", {{"Authorization", "Bearer " + token}})->status, 200);
  EXPECT_EQ(http_->Get("/v1/workers", {{"Cookie", "a=b; meshwright-token=" + token}})->status, 200);
}

TEST_F(RestTest, ServesThePageAndNothingBesideIt) {
  Stop();
  const std::string page = folder_ + "/page";
  std::filesystem::create_directories(page + "/assets");
  ASSERT_TRUE(WriteFileAtomically(page + "/index.html", "<title>page</title>").ok());
  ASSERT_TRUE(WriteFileAtomically(page + "/assets/a-1f.js", "1").ok());
  ASSERT_TRUE(WriteFileAtomically(folder_ + "/secret.txt", "secret").ok());
  std::filesystem::create_symlink(folder_ + "/secret.txt", page + "/link.txt");
  settings_.page_folder = page;
  Start();
  for (const char* path : {"/", "/reconstructions/c7", "/workers"}) {
    const auto result = http_->Get(path);
    EXPECT_EQ(result->status, 200) << path;
    EXPECT_THAT(result->get_header_value("Content-Type"), StartsWith("text/html"));
    EXPECT_EQ(result->get_header_value("Cache-Control"), "no-cache");
  }
  const auto script = http_->Get("/assets/a-1f.js");
  EXPECT_THAT(script->get_header_value("Content-Type"), StartsWith("text/javascript"));
  EXPECT_THAT(script->get_header_value("Cache-Control"), HasSubstr("immutable"));
  for (const char* path : {"/../secret.txt", "/assets/../../secret.txt", "/%2e%2e/secret.txt", "/..%2fsecret.txt",
                           "/link.txt", "//etc/passwd", "/assets/none.js", "/.hidden", "/v1/none", "/assets\\..\\x"}) {
    EXPECT_EQ(http_->Get(path)->status, 404) << path;
  }
}

}  // namespace
}  // namespace meshwright
