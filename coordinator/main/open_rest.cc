#include "coordinator/main/open_rest.h"

#include <filesystem>
#include <string>

#include <absl/strings/ascii.h>
#include <absl/strings/str_cat.h>

#include "pipeline/options/options_json.h"

#include "common/base/files.h"
#include "common/base/status_macros.h"

namespace meshwright {
namespace {

namespace fs = std::filesystem;

constexpr size_t kMinTokenLength = 16;

absl::StatusOr<std::string> ReadToken(const std::string& path) {
  if (path.empty()) return std::string();
  MW_ASSIGN_OR_RETURN(const std::string text, ReadFile(path));
  std::string token(absl::StripAsciiWhitespace(text));
  if (token.size() < kMinTokenLength) {
    return absl::InvalidArgumentError(
        absl::StrCat(path, ": api-token-file has ", token.size(), " characters, expected at least ", kMinTokenLength));
  }
  return token;
}

// Beside the program as it is installed, or in the tree that it was built in. "": nowhere.
std::string FindPage() {
  std::error_code error;
  const fs::path program = fs::read_symlink("/proc/self/exe", error);
  for (const char* place : {"../share/meshwright/dashboard", "../../../dashboard/dist"}) {
    const fs::path folder = program.parent_path() / place;
    if (fs::exists(folder / "index.html", error)) return folder.lexically_normal();
  }
  return "";
}

}  // namespace

absl::StatusOr<std::unique_ptr<RestServer>> OpenRest(const CoordinatorSettings& settings,
                                                     ReconstructionService& reconstructions, WorkerService& workers,
                                                     BlobStore& blobs, JobStore& store) {
  if (settings.rest_listen.empty()) return nullptr;
  RestOptions options = {.listen = settings.rest_listen,
                         .folder = settings.data_folder + "/rest",
                         .page_folder = settings.page_folder.empty() ? FindPage() : settings.page_folder};
  if (!settings.page_folder.empty() && !fs::exists(settings.page_folder + "/index.html")) {
    return absl::NotFoundError(absl::StrCat(settings.page_folder, ": dashboard has no index.html"));
  }
  MW_ASSIGN_OR_RETURN(options.token, ReadToken(settings.api_token_file));
  RestServices services = {.reconstructions = &reconstructions,
                           .workers = &workers,
                           .blobs = &blobs,
                           .options_json = DescribeOptionsForRest()};
  services.ready = [&blobs, &store]() -> absl::Status {
    MW_RETURN_IF_ERROR(store.Now().status());
    // No blob has this digest; who says so can be reached.
    const absl::Status found = blobs.Get(std::string(64, '0')).status();
    return absl::IsNotFound(found) ? absl::OkStatus() : found;
  };
  return RestServer::Start(options, services);
}

}  // namespace meshwright
