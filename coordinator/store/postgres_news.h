// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>

#include "coordinator/store/store_news.h"

namespace meshwright {

// By LISTEN and NOTIFY of PostgreSQL (https://www.postgresql.org/docs/15/sql-notify.html), over one connection of its
// own, which is made again when it breaks.
std::unique_ptr<StoreNewsChannel> OpenPostgresNews(const std::string& url);

}  // namespace meshwright
