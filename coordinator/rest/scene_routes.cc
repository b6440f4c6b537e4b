// SPDX-License-Identifier: Apache-2.0
#include <limits>
#include <utility>

#include <absl/strings/str_cat.h>

#include "common/base/status_macros.h"
#include "common/image/decode.h"
#include "common/image/encode.h"
#include "coordinator/api/scene_upload.h"
#include "coordinator/rest/json.h"
#include "coordinator/rest/problem.h"
#include "coordinator/rest/routes.h"

namespace meshwright {
namespace {

constexpr int64_t kMaxPartBytes = int64_t{256} << 20;
constexpr int kJpegQuality = 85;
constexpr char kOffsetHeader[] = "Upload-Offset";

nlohmann::ordered_json FileJson(const SceneFileState& file) {
  return {{"path", file.path},
          {"sizeBytes", absl::StrCat(file.size_bytes)},
          {"sha256", file.sha256},
          {"offsetBytes", absl::StrCat(file.offset_bytes)},
          {"complete", file.complete}};
}

absl::Status Answer(RestCall& call, const SceneFileState& file) {
  call.response.headers.Set(kOffsetHeader, absl::StrCat(file.offset_bytes));
  call.response.status = 200;
  call.response.SetContent(Dump(FileJson(file)), kJsonType);
  return absl::OkStatus();
}

// An error says in the header where to go on, if that is known.
absl::Status WithOffset(HttpResponse& response, const absl::Status& status) {
  if (const std::optional<int64_t> offset = ExpectedOffsetOf(status)) {
    response.headers.Set(kOffsetHeader, absl::StrCat(*offset));
  }
  return status;
}

absl::Status ListFiles(const RestContext& context, RestCall& call) {
  MW_ASSIGN_OR_RETURN(const std::vector<SceneFileState> files, context.uploads->List(call.path.at("id")));
  nlohmann::ordered_json response;
  response["files"] = nlohmann::ordered_json::array();
  for (const SceneFileState& file : files) response["files"].push_back(FileJson(file));
  call.response.SetContent(Dump(response), kJsonType);
  return absl::OkStatus();
}

absl::Status GetFile(const RestContext& context, RestCall& call) {
  MW_ASSIGN_OR_RETURN(const SceneFileState file, context.uploads->Get(call.path.at("id"), call.path.at("path")));
  return Answer(call, file);
}

absl::Status PutFile(const RestContext& context, RestCall& call) {
  SceneFilePart part = {.path = call.path.at("path")};
  MW_ASSIGN_OR_RETURN(part.size_bytes, QueryNumber(call, "size", 0, kMaxSceneFileBytes, -1));
  if (part.size_bytes < 0) {
    return FieldError("size", absl::InvalidArgumentError("size is missing, expected the bytes of the whole file"));
  }
  MW_ASSIGN_OR_RETURN(part.offset_bytes, QueryNumber(call, "offset", 0, kMaxSceneFileBytes, 0));
  part.sha256 = call.request.Param("sha256");
  part.part_sha256 = call.request.Param("partSha256");
  auto begun = context.uploads->Begin(call.path.at("id"), part);
  if (!begun.ok()) return WithOffset(call.response, begun.status());
  const std::shared_ptr<ScenePartUpload> upload = *std::move(begun);
  const absl::Status has_room = context.gate->ReserveSceneBytes(call.path.at("id"), part.path, part.size_bytes);
  if (absl::IsResourceExhausted(has_room)) return HttpError(507, has_room);
  return TakeBody(
      call, kMaxPartBytes,
      [upload, &response = call.response](absl::Span<const uint8_t> bytes) {
        return WithOffset(response, upload->Append(bytes));
      },
      [upload, &context](RestCall& taken) -> absl::Status {
        const absl::StatusOr<SceneFileState> file = upload->Finish();
        MW_RETURN_IF_ERROR(WithOffset(taken.response, file.status()));
        if (file->complete) context.gate->ReleaseSceneBytes(taken.path.at("id"), file->path);
        return Answer(taken, *file);
      });
}

absl::Status Photo(const RestContext& context, RestCall& call) {
  MW_ASSIGN_OR_RETURN(const int64_t width, QueryNumber(call, "width", 16, 2048, 640));
  MW_ASSIGN_OR_RETURN(const int64_t camera, PathNumber(call, "camera", 0, std::numeric_limits<int32_t>::max()));
  MW_ASSIGN_OR_RETURN(const Scene scene, context.reconstructions->LoadScene(call.path.at("id")));
  if (static_cast<size_t>(camera) >= scene.views.size()) {
    return absl::NotFoundError(absl::StrCat("camera is ", camera, ", expected 0..", scene.views.size() - 1));
  }
  const SceneView& view = scene.views[static_cast<size_t>(camera)];
  const std::string& digest = view.image_path;
  return SendImmutable(call, absl::StrCat(digest, "-", width), "image/jpeg", [&]() -> absl::StatusOr<std::string> {
    MW_ASSIGN_OR_RETURN(const std::string bytes, context.blobs->Get(digest));
    MW_ASSIGN_OR_RETURN(const ColorImage image, DecodeReduced(bytes, view.name, static_cast<int>(width)));
    return EncodeJpeg(image, kJpegQuality);
  });
}

}  // namespace

void AddSceneRoutes(const RestContext& context, std::vector<Route>& routes) {
  const auto add = [&](const char* method, const char* path, std::vector<std::string> query, auto handler) {
    routes.push_back({method, path, std::move(query),
                      [&context, handler](RestCall& call) -> absl::Status { return handler(context, call); }});
  };
  add("GET", "/v1/reconstructions/{id}/files", {}, ListFiles);
  add("GET", "/v1/reconstructions/{id}/files/{path}", {}, GetFile);
  add("PUT", "/v1/reconstructions/{id}/files/{path}", {"size", "sha256", "offset", "partSha256"}, PutFile);
  add("GET", "/v1/reconstructions/{id}/cameras/{camera}/photo", {"width"}, Photo);
}

}  // namespace meshwright
