// SPDX-License-Identifier: Apache-2.0
#include <filesystem>
#include <functional>
#include <limits>
#include <system_error>
#include <utility>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include "common/base/digest.h"
#include "common/base/status_macros.h"
#include "common/mesh/formats/mesh_format.h"
#include "common/mesh/formats/mesh_rows.h"
#include "common/mesh/formats/tileset.h"
#include "common/mesh/ply.h"
#include "common/mesh/surface_mesh.h"
#include "common/surface/codec.h"
#include "coordinator/api/photograph_files.h"
#include "coordinator/rest/json.h"
#include "coordinator/rest/part_preview.h"
#include "coordinator/rest/problem.h"
#include "coordinator/rest/routes.h"

namespace meshwright {
namespace {

constexpr int64_t kMaxSequence = std::numeric_limits<SequenceNumber>::max();
constexpr char kPlyType[] = "model/ply";
constexpr char kGlbType[] = "model/gltf-binary";
constexpr char kTileset[] = "tileset.json";
constexpr int64_t kDefaultPreviewFaces = 20'000;
constexpr int64_t kMaxPreviewFaces = 4'000'000;

absl::StatusOr<v1::Part> FindPart(const RestContext& context, const RestCall& call) {
  MW_ASSIGN_OR_RETURN(const int64_t sequence, PathNumber(call, "sequence", 1, kMaxSequence));
  return context.reconstructions->GetPart(call.path.at("id"), static_cast<SequenceNumber>(sequence));
}

absl::Status ListParts(const RestContext& context, RestCall& call) {
  MW_ASSIGN_OR_RETURN(const int64_t after, QueryNumber(call, "after", 0, kMaxSequence, 0));
  MW_ASSIGN_OR_RETURN(const v1::ListPartsResponse parts,
                      context.reconstructions->ListParts(call.path.at("id"), static_cast<SequenceNumber>(after)));
  call.response.SetContent(ToJson(parts), kJsonType);
  return absl::OkStatus();
}

// "" for none.
std::string TextOf(const Eigen::Vector3d& offset) {
  return offset.isZero(0) ? "" : absl::StrFormat("-%.17g-%.17g-%.17g", offset.x(), offset.y(), offset.z());
}

absl::Status DownloadPart(const RestContext& context, RestCall& call) {
  MW_ASSIGN_OR_RETURN(const v1::Part part, FindPart(context, call));
  // The same surface in a scene that was moved is another file.
  MW_ASSIGN_OR_RETURN(const Eigen::Vector3d offset, context.reconstructions->OffsetOf(call.path.at("id")));
  const std::string key = absl::StrCat("part-", part.sha256(), TextOf(offset));
  MW_ASSIGN_OR_RETURN(auto file, context.derived->Get(key, [&](const std::string& path) -> absl::Status {
    MW_ASSIGN_OR_RETURN(const std::string bytes, context.blobs->Get(part.sha256()));
    MW_ASSIGN_OR_RETURN(const PatchLattice surface, DecodeSurface(bytes));
    return WriteSurfacePart(surface, offset, path);
  }));
  return SendFile(call, std::move(file), key, kPlyType, absl::StrCat(call.path.at("id"), "-", part.sequence(), ".ply"));
}

absl::Status DownloadSurface(const RestContext& context, RestCall& call) {
  MW_ASSIGN_OR_RETURN(const v1::Part part, FindPart(context, call));
  return SendImmutable(call, part.sha256(), "application/octet-stream",
                       [&] { return context.blobs->Get(part.sha256()); });
}

absl::Status PreviewPart(const RestContext& context, RestCall& call) {
  MW_ASSIGN_OR_RETURN(const int64_t max_faces,
                      QueryNumber(call, "max_faces", 1, kMaxPreviewFaces, kDefaultPreviewFaces));
  MW_ASSIGN_OR_RETURN(const v1::Part part, FindPart(context, call));
  const std::string etag = absl::StrCat(part.sha256(), "-", part.sequence(), "-", max_faces);
  return SendImmutable(call, etag, "application/octet-stream", [&]() -> absl::StatusOr<std::string> {
    MW_ASSIGN_OR_RETURN(const std::string bytes, context.blobs->Get(part.sha256()));
    MW_ASSIGN_OR_RETURN(const SparseSurface surface, DecodeSparseSurface(bytes));
    return MakePartPreview(surface, part.sequence(), max_faces);
  });
}

Eigen::Vector3d OffsetOf(const v1::ListPartsResponse& parts) {
  if (parts.offset_size() != 3) return Eigen::Vector3d::Zero();
  return {parts.offset(0), parts.offset(1), parts.offset(2)};
}

// One surface in memory at a time.
absl::Status WriteUnion(const v1::ListPartsResponse& parts, BlobStore& blobs, const std::string& path) {
  MW_ASSIGN_OR_RETURN(
      PlyStreamWriter writer,
      PlyStreamWriter::Create(
          path, {.normals = true, .colors = true, .quality = true, .cameras = true, .offset = OffsetOf(parts)}));
  for (const v1::Part& part : parts.parts()) {
    MW_ASSIGN_OR_RETURN(const std::string bytes, blobs.Get(part.sha256()));
    MW_ASSIGN_OR_RETURN(const PatchLattice surface, DecodeSurface(bytes));
    MW_RETURN_IF_ERROR(writer.Append(MeshOfSurface(surface)));
  }
  return writer.Commit();
}

// Answers with `ply` in the format. `key`: names the PLY's bytes; `name`: what a browser saves it as, without ending.
absl::Status SendAs(const RestContext& context, RestCall& call, const MeshFormat& format, const std::string& ply_path,
                    const std::string& key, const std::string& name) {
  const std::string derived_key = absl::StrCat(format.name, "-", key);
  MW_ASSIGN_OR_RETURN(auto file, context.derived->Get(derived_key, [&](const std::string& path) {
    return ConvertPly(ply_path, format, false, path);
  }));
  return SendFile(call, std::move(file), derived_key, format.media_type, absl::StrCat(name, format.ending));
}

// The parts accepted so far, side by side.
absl::Status SendPartialMesh(const RestContext& context, RestCall& call, const MeshFormat& format) {
  const std::string& id = call.path.at("id");
  MW_ASSIGN_OR_RETURN(const v1::ListPartsResponse parts, context.reconstructions->ListParts(id));
  std::string digests;
  for (const v1::Part& part : parts.parts()) digests += part.sha256();
  const std::string key = absl::StrCat("union-", format.name, "-", Sha256Hex(digests), TextOf(OffsetOf(parts)));
  MW_ASSIGN_OR_RETURN(auto file, context.derived->Get(key, [&](const std::string& to) -> absl::Status {
    if (IsPly(format)) return WriteUnion(parts, *context.blobs, to);
    const std::string ply = to + ".ply";
    absl::Status written = WriteUnion(parts, *context.blobs, ply);
    if (written.ok()) written = ConvertPly(ply, format, false, to);
    std::error_code error;
    std::filesystem::remove(ply, error);
    return written;
  }));
  return SendFile(call, std::move(file), key, format.media_type, absl::StrCat(id, "-partial", format.ending));
}

// Calls `write` with the scene, whose photographs are files as long as it lasts, in a folder beside `path`.
absl::Status WithSceneFiles(const RestContext& context, const std::string& id, const std::string& path,
                            const std::function<absl::Status(const Scene& scene)>& write) {
  const std::string folder = path + ".photographs";
  absl::StatusOr<Scene> scene = context.reconstructions->LoadScene(id);
  if (scene.ok()) scene = WithPhotographFiles(*std::move(scene), *context.blobs, folder);
  const absl::Status written = scene.ok() ? write(*scene) : scene.status();
  std::error_code error;
  std::filesystem::remove_all(folder, error);
  return written;
}

// The mesh, few triangles with a texture cut from the photographs.
absl::Status SendTextured(const RestContext& context, RestCall& call, const MeshFormat& format) {
  const std::string& id = call.path.at("id");
  MW_ASSIGN_OR_RETURN(const v1::Reconstruction reconstruction, context.reconstructions->Get(id));
  MW_ASSIGN_OR_RETURN(const std::string ply_path, context.reconstructions->MeshPath(id));
  const std::string key = absl::StrCat("textured-", format.name, "-", id, "-", reconstruction.mesh_sha256());
  MW_ASSIGN_OR_RETURN(auto file, context.textured->Get(key, [&](const std::string& path) -> absl::Status {
    return WithSceneFiles(context, id, path, [&](const Scene& scene) {
      return context.write_textured({.ply_path = ply_path,
                                     .scene = &scene,
                                     .options_json = reconstruction.options_json(),
                                     .format = &format,
                                     .path = path});
    });
  }));
  return SendFile(call, std::move(file), key, format.media_type, absl::StrCat(id, "-textured", format.ending));
}

// One file of the mesh as a tileset, which is made when the first of them is asked for.
absl::Status DownloadTile(const RestContext& context, RestCall& call) {
  const std::string& id = call.path.at("id");
  const std::string& name = call.path.at("path");
  MW_ASSIGN_OR_RETURN(const v1::Reconstruction reconstruction, context.reconstructions->Get(id));
  MW_ASSIGN_OR_RETURN(const std::string ply_path, context.reconstructions->MeshPath(id));
  const std::string key = absl::StrCat("tileset-", reconstruction.mesh_sha256());
  MW_ASSIGN_OR_RETURN(auto file, context.tilesets->GetFrom(key, name, [&](const std::string& folder) -> absl::Status {
    MW_ASSIGN_OR_RETURN(const MeshRows mesh, MeshRows::OpenPly(ply_path));
    return WriteTileset(mesh, absl::StrCat(folder, "/", kTileset), {.compressed = true});
  }));
  const size_t slash = name.rfind('/');
  return SendFile(call, std::move(file), absl::StrCat(key, "-", Sha256Hex(name).substr(0, 16)),
                  name == kTileset ? kJsonType : kGlbType, slash == std::string::npos ? name : name.substr(slash + 1));
}

absl::Status ShowReport(const RestContext& context, RestCall& call) {
  const std::string& id = call.path.at("id");
  MW_ASSIGN_OR_RETURN(const v1::Reconstruction reconstruction, context.reconstructions->Get(id));
  MW_ASSIGN_OR_RETURN(const std::string ply_path, context.reconstructions->MeshPath(id));
  const std::string key = absl::StrCat("report-", id, "-", reconstruction.mesh_sha256());
  MW_ASSIGN_OR_RETURN(auto file, context.textured->Get(key, [&](const std::string& path) -> absl::Status {
    return WithSceneFiles(context, id, path, [&](const Scene& scene) {
      return context.write_report(
          {.reconstruction = &reconstruction, .ply_path = ply_path, .scene = &scene, .path = path});
    });
  }));
  MW_RETURN_IF_ERROR(
      SendFile(call, std::move(file), key, "text/html; charset=utf-8", absl::StrCat(id, "-report.html")));
  // To be looked at, not saved; it has pictures and a style in itself and asks for nothing else.
  call.response.headers.Set("Content-Disposition", "inline");
  call.response.headers.Set("Content-Security-Policy",
                            "default-src 'none'; img-src data:; style-src 'unsafe-inline'; sandbox");
  return absl::OkStatus();
}

absl::StatusOr<const MeshFormat*> QueryFormat(const RestCall& call) {
  constexpr char kName[] = "format";
  if (!call.request.HasParam(kName)) return &MeshFormats().front();
  absl::StatusOr<const MeshFormat*> format = MeshFormatByName(call.request.Param(kName));
  if (!format.ok()) return FieldError(kName, format.status());
  return format;
}

absl::Status SendMesh(const RestContext& context, RestCall& call, const MeshFormat& format, bool partial) {
  const std::string& id = call.path.at("id");
  MW_ASSIGN_OR_RETURN(const v1::Reconstruction reconstruction, context.reconstructions->Get(id));
  if (partial && reconstruction.state() != v1::RECONSTRUCTION_STATE_DONE) return SendPartialMesh(context, call, format);
  MW_ASSIGN_OR_RETURN(const std::string path, context.reconstructions->MeshPath(id));
  if (!IsPly(format)) return SendAs(context, call, format, path, reconstruction.mesh_sha256(), id);
  MW_ASSIGN_OR_RETURN(auto file, OpenedFile::Open(path));
  return SendFile(call, std::move(file), reconstruction.mesh_sha256(), format.media_type,
                  absl::StrCat(id, format.ending));
}

absl::Status DownloadMesh(const RestContext& context, RestCall& call) {
  MW_ASSIGN_OR_RETURN(const bool partial, QueryFlag(call, "partial"));
  MW_ASSIGN_OR_RETURN(const MeshFormat* format, QueryFormat(call));
  MW_ASSIGN_OR_RETURN(const bool texture, QueryFlag(call, "texture"));
  if (texture && (partial || std::string(format->name) != "glb")) {
    return FieldError(
        "texture",
        absl::InvalidArgumentError("texture is true, expected format=glb with it, which is one file, and not partial"));
  }
  if (texture) return SendTextured(context, call, *format);
  return SendMesh(context, call, *format, partial);
}

absl::Status DownloadGlb(const RestContext& context, RestCall& call) {
  MW_ASSIGN_OR_RETURN(const MeshFormat* format, MeshFormatByName("glb"));
  return SendMesh(context, call, *format, false);
}

absl::Status ListFormats(const RestContext& context, RestCall& call) {
  call.response.SetContent(DescribeMeshFormats(), kJsonType);
  return absl::OkStatus();
}

}  // namespace

void AddResultRoutes(const RestContext& context, std::vector<Route>& routes) {
  const auto add = [&](const char* path, std::vector<std::string> query, auto handler) {
    routes.push_back({"GET", path, std::move(query),
                      [&context, handler](RestCall& call) -> absl::Status { return handler(context, call); }});
  };
  add("/v1/reconstructions/{id}/parts", {"after"}, ListParts);
  add("/v1/reconstructions/{id}/parts/{sequence}", {}, DownloadPart);
  add("/v1/reconstructions/{id}/parts/{sequence}/surface", {}, DownloadSurface);
  add("/v1/reconstructions/{id}/parts/{sequence}/preview", {"max_faces"}, PreviewPart);
  add("/v1/reconstructions/{id}/mesh", {"partial", "format", "texture"}, DownloadMesh);
  add("/v1/reconstructions/{id}/mesh.glb", {}, DownloadGlb);
  add("/v1/reconstructions/{id}/tiles/{path}", {}, DownloadTile);
  add("/v1/reconstructions/{id}/report", {}, ShowReport);
  add("/v1/formats", {}, ListFormats);
}

}  // namespace meshwright
