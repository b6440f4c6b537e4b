#include "coordinator/main/open_rest.h"

#include <filesystem>
#include <string>

#include "pipeline/options/options_json.h"

#include "common/base/status_macros.h"

namespace meshwright {
namespace {

namespace fs = std::filesystem;

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
                                                     BlobStore& blobs, JobStore& store, Gatekeeper& gate,
                                                     const Logger& log) {
  if (settings.rest_listen.empty()) return nullptr;
  RestOptions options = {.listen = settings.rest_listen,
                         .folder = settings.data_folder + "/rest",
                         .page_folder = settings.page_folder.empty() ? FindPage() : settings.page_folder};
  options.tls_certificate_file = settings.rest_tls_certificate_file;
  options.tls_key_file = settings.rest_tls_key_file;
  options.trusted_proxies = {settings.trusted_proxies.begin(), settings.trusted_proxies.end()};
  options.warn = [&log](const std::string& text) { log.Warning(text); };
  RestServices services = {.reconstructions = &reconstructions,
                           .workers = &workers,
                           .blobs = &blobs,
                           .gate = &gate,
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
// SPDX-License-Identifier: Apache-2.0
