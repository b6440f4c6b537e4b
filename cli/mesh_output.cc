#include "cli/mesh_output.h"

#include <filesystem>
#include <system_error>

#include <absl/strings/str_cat.h>
#include <unistd.h>

#include "common/base/status_macros.h"
#include "common/mesh/formats/mesh_format.h"

namespace meshwright {

absl::Status FetchMesh(ServiceClient& client, const std::string& id, const std::string& path) {
  MW_ASSIGN_OR_RETURN(const MeshFormat* format, MeshFormatOfPath(path));
  if (IsPly(*format)) return client.Fetch(id, path);
  const std::string ply = absl::StrCat(path, ".partial-", ::getpid(), ".ply");
  absl::Status fetched = client.Fetch(id, ply);
  if (fetched.ok()) fetched = ConvertPly(ply, *format, false, path);
  std::error_code error;
  std::filesystem::remove(ply, error);
  return fetched;
}

}  // namespace meshwright
