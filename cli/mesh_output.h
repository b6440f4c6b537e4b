// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include <absl/status/status.h>

#include "clients/cpp/service_client.h"

namespace meshwright {

// Downloads the mesh and writes it in the format that the ending of `path` says. `partial`: while it is not done, the
// surfaces accepted so far, side by side. FailedPrecondition where there is nothing yet.
absl::Status FetchMesh(ServiceClient& client, const std::string& id, const std::string& path, bool partial);

}  // namespace meshwright
