// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "coordinator/rest/router.h"

namespace meshwright {

// Serves the dashboard's files below `folder` for GET and HEAD; other paths of pages get index.html, as the page finds
// its way by itself. Files whose names carry a digest (those in assets/) are kept by browsers, all others are asked for
// again. NotFound for what is not there, and for everything when `folder` is "" or has no index.html.
absl::Status SendPage(RestCall& call, const std::string& folder);

}  // namespace meshwright
