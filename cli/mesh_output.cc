// SPDX-License-Identifier: Apache-2.0
#include "cli/mesh_output.h"

#include <filesystem>
#include <system_error>

#include <absl/strings/str_cat.h>

#include "cli/service_arguments.h"
#include "common/base/files.h"
#include "common/base/status_macros.h"
#include "common/mesh/formats/mesh_format.h"
#include "common/mesh/ply.h"
#include "common/mesh/surface_mesh.h"
#include "common/surface/codec.h"

namespace meshwright {
namespace {

// The surfaces accepted so far side by side, one in memory at a time.
absl::Status FetchParts(ServiceClient& client, const std::string& id, const std::string& path) {
  MW_ASSIGN_OR_RETURN(const v1::ListPartsResponse parts, client.ListParts(id));
  if (parts.parts().empty()) return absl::FailedPreconditionError(absl::StrCat(id, ": no surface is accepted yet"));
  PlyAttributes attributes = {.normals = true, .colors = true, .quality = true, .cameras = true};
  if (parts.offset_size() == 3) attributes.offset = {parts.offset(0), parts.offset(1), parts.offset(2)};
  MW_ASSIGN_OR_RETURN(PlyStreamWriter writer, PlyStreamWriter::Create(path, attributes));
  for (const v1::Part& part : parts.parts()) {
    MW_ASSIGN_OR_RETURN(const std::string bytes, client.DownloadPart(id, part));
    MW_ASSIGN_OR_RETURN(const PatchLattice surface, DecodeSurface(bytes));
    MW_RETURN_IF_ERROR(writer.Append(MeshOfSurface(surface)));
  }
  return writer.Commit();
}

absl::Status FetchPly(ServiceClient& client, const std::string& id, const std::string& path, bool partial) {
  MW_ASSIGN_OR_RETURN(const v1::Reconstruction reconstruction, client.Get(id));
  if (reconstruction.state() == v1::RECONSTRUCTION_STATE_DONE) return client.Fetch(id, path);
  if (partial) return FetchParts(client, id, path);
  return absl::FailedPreconditionError(absl::StrCat(id, " is ", NameOf(reconstruction.state()),
                                                    " and has no mesh; --partial takes the surfaces so far"));
}

}  // namespace

absl::Status FetchMesh(ServiceClient& client, const std::string& id, const std::string& path, bool partial) {
  MW_ASSIGN_OR_RETURN(const MeshFormat* format, MeshFormatOfPath(path));
  if (IsPly(*format)) return FetchPly(client, id, path, partial);
  std::error_code error;
  if (format->has_folder) std::filesystem::create_directories(std::filesystem::path(path).parent_path(), error);
  const std::string ply = PartialPath(path) + ".ply";
  absl::Status fetched = FetchPly(client, id, ply, partial);
  if (fetched.ok()) fetched = ConvertPly(ply, *format, false, path);
  std::filesystem::remove(ply, error);
  return fetched;
}

}  // namespace meshwright
