// SPDX-License-Identifier: Apache-2.0
#include "coordinator/main/check_settings.h"

#include <filesystem>
#include <utility>

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>

#include "common/base/files.h"
#include "common/base/host_port.h"
#include "common/base/status_macros.h"
#include "common/base/token_file.h"
#include "common/blob/open_blob_store.h"
#include "coordinator/main/open_job_store.h"
#include "coordinator/webhook/webhook_sender.h"

namespace meshwright {
namespace {

namespace fs = std::filesystem;

absl::Status CheckAddress(const std::string& text, const char* flag, bool is_optional) {
  if (text.empty() && is_optional) return absl::OkStatus();
  return ParseHostPort(text, flag).status();
}

absl::Status CheckFolder(const std::string& folder, const char* flag) {
  std::error_code error;
  if (fs::is_directory(folder, error)) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat(flag, " is ", folder, ", expected a folder that is there"));
}

absl::Status CheckBlobs(const std::string& where) {
  if (!absl::StrContains(where, "://")) return absl::OkStatus();
  if (const auto url = ParseS3Url(where); !url.ok()) {
    return absl::InvalidArgumentError(absl::StrCat("--blobs is ", where, ", expected a folder or s3://BUCKET/PREFIX"));
  }
  return absl::OkStatus();
}

absl::Status CheckPage(const std::string& folder) {
  std::error_code error;
  if (folder.empty() || fs::exists(fs::path(folder) / "index.html", error)) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat("--dashboard is ", folder, ", which has no index.html"));
}

// Who opens the service to other machines says who may use it.
absl::Status CheckExposure(const CoordinatorSettings& settings) {
  if (!settings.api_token_file.empty() || settings.insecure) return absl::OkStatus();
  for (const auto& [flag, address] :
       {std::pair("--listen", settings.listen), std::pair("--rest-listen", settings.rest_listen),
        std::pair("--nodeodm-listen", settings.nodeodm_listen)}) {
    if (address.empty()) continue;
    MW_ASSIGN_OR_RETURN(const HostPort listen, ParseHostPort(address, flag));
    if (IsLoopbackHost(listen.host)) continue;
    return absl::InvalidArgumentError(
        absl::StrCat(flag, " is ", address,
                     ", which other machines reach, and nobody would "
                     "have to show a key: expected --api-token-file FILE, or --insecure"));
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status CheckSettings(const CoordinatorSettings& settings) {
  if (settings.data_folder.empty()) return absl::InvalidArgumentError("--data is required");
  MW_RETURN_IF_ERROR(CheckAddress(settings.listen, "--listen", /*is_optional=*/false));
  MW_RETURN_IF_ERROR(CheckAddress(settings.rest_listen, "--rest-listen", /*is_optional=*/true));
  MW_RETURN_IF_ERROR(CheckAddress(settings.nodeodm_listen, "--nodeodm-listen", /*is_optional=*/true));
  MW_RETURN_IF_ERROR(CheckAddress(settings.metrics_listen, "--metrics-listen", /*is_optional=*/true));
  if (!settings.store.empty()) MW_RETURN_IF_ERROR(CheckJobStore(settings.store));
  MW_RETURN_IF_ERROR(CheckBlobs(settings.blobs));
  for (const std::string& root : settings.scene_roots) MW_RETURN_IF_ERROR(CheckFolder(root, "--scene-root"));
  MW_RETURN_IF_ERROR(CheckPage(settings.page_folder));
  if (settings.rest_tls_certificate_file.empty() != settings.rest_tls_key_file.empty()) {
    return absl::InvalidArgumentError("--rest-tls-cert and --rest-tls-key: expected both or none");
  }
  if (settings.webhook_url.empty() != settings.webhook_secret_file.empty()) {
    return absl::InvalidArgumentError("--webhook-url and --webhook-secret-file: expected both or none");
  }
  if (!settings.webhook_url.empty()) {
    if (const absl::Status url = WebhookSender::CheckUrl(settings.webhook_url); !url.ok()) {
      return absl::InvalidArgumentError(absl::StrCat("--webhook-url is ", std::string(url.message())));
    }
  }
  MW_RETURN_IF_ERROR(ReadTokenFile(settings.webhook_secret_file, "--webhook-secret-file").status());
  if (settings.tls_certificate_file.empty() != settings.tls_key_file.empty()) {
    return absl::InvalidArgumentError("--tls-cert and --tls-key: expected both or none");
  }
  for (const std::string& file : {settings.tls_certificate_file, settings.tls_key_file, settings.client_ca_file}) {
    if (!file.empty()) MW_RETURN_IF_ERROR(ReadFile(file).status());
  }
  MW_RETURN_IF_ERROR(ReadTokenFile(settings.api_token_file, "--api-token-file").status());
  MW_RETURN_IF_ERROR(ReadTokenFile(settings.worker_token_file, "--worker-token-file").status());
  if (settings.api_token_file.empty() && !settings.worker_token_file.empty()) {
    return absl::InvalidArgumentError(
        "--worker-token-file: expected with --api-token-file, or nobody is asked for a key");
  }
  if (!settings.client_ca_file.empty() && settings.tls_certificate_file.empty()) {
    return absl::InvalidArgumentError("--client-ca-file: expected with --tls-cert and --tls-key");
  }
  if (!settings.client_ca_file.empty() && settings.api_token_file.empty()) {
    return absl::InvalidArgumentError("--client-ca-file: expected with --api-token-file, or nobody is asked for a key");
  }
  return CheckExposure(settings);
}

}  // namespace meshwright
