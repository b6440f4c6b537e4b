// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <set>
#include <string>

#include "common/http_server/http_message.h"

namespace meshwright {

// GET and HEAD.
bool OnlyReads(const HttpRequest& request);

// Whether a request that changes something is another site's doing, in the browser of somebody who can reach this one.
bool IsForeign(const HttpRequest& request);

// Whether the request came by a name of the Internet's that somebody lets mean this machine (DNS rebinding). Who
// listens, "host:port", on the loopback alone has none; behind a proxy the name may be the proxy's.
bool IsRebound(const HttpRequest& request, const std::string& listen, const std::set<std::string>& trusted_proxies);

}  // namespace meshwright
