// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>

#include <absl/status/statusor.h>

#include "common/blob/blob_store.h"
#include "common/blob/s3_client.h"

namespace meshwright {

// A folder, or "s3://BUCKET/PREFIX". The keys, the region and the server's address are in the environment, under the
// names that other programs know: AWS_ACCESS_KEY_ID, AWS_SECRET_ACCESS_KEY, AWS_SESSION_TOKEN, AWS_REGION,
// AWS_ENDPOINT_URL.
absl::StatusOr<std::unique_ptr<BlobStore>> OpenBlobStore(const std::string& where);

// InvalidArgument unless `url` is "s3://BUCKET" or "s3://BUCKET/PREFIX". Without the keys.
absl::StatusOr<S3Options> ParseS3Url(const std::string& url);

}  // namespace meshwright
