// SPDX-License-Identifier: Apache-2.0
#include "common/blob/open_blob_store.h"

#include <cstdlib>

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>

#include "common/base/status_macros.h"
#include "common/blob/filesystem_blob_store.h"
#include "common/blob/s3_blob_store.h"

namespace meshwright {
namespace {

constexpr char kS3Scheme[] = "s3://";

std::string Environment(const char* name, const std::string& otherwise) {
  const char* const value = std::getenv(name);
  return value != nullptr && *value != '\0' ? value : otherwise;
}

}  // namespace

absl::StatusOr<S3Options> ParseS3Url(const std::string& url) {
  S3Options options;
  const std::string path = absl::StartsWith(url, kS3Scheme) ? url.substr(sizeof(kS3Scheme) - 1) : "";
  const size_t slash = path.find('/');
  options.bucket = path.substr(0, slash);
  if (options.bucket.empty()) {
    return absl::InvalidArgumentError(absl::StrCat("blobs \"", url, "\": s3://BUCKET/PREFIX expected"));
  }
  if (slash != std::string::npos) options.prefix = path.substr(slash + 1);
  if (!options.prefix.empty() && !absl::EndsWith(options.prefix, "/")) options.prefix += "/";
  options.region = Environment("AWS_REGION", options.region);
  options.endpoint = Environment("AWS_ENDPOINT_URL", absl::StrCat("https://s3.", options.region, ".amazonaws.com"));
  return options;
}

absl::StatusOr<std::unique_ptr<BlobStore>> OpenBlobStore(const std::string& where) {
  if (!absl::StartsWith(where, kS3Scheme)) return FilesystemBlobStore::Open(where);
  MW_ASSIGN_OR_RETURN(S3Options options, ParseS3Url(where));
  MW_RETURN_IF_ERROR(ReadS3Credentials(&options));
  return S3BlobStore::Open(options);
}

}  // namespace meshwright
