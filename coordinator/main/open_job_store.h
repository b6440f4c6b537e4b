// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>

#include <absl/status/statusor.h>

#include "coordinator/store/job_store.h"
#include "coordinator/store/sql_database.h"
#include "coordinator/store/store_news.h"

namespace meshwright {

// "sqlite:PATH" or "postgresql://USER@HOST:PORT/DATABASE". InvalidArgument for anything else.
// InvalidArgument unless OpenJobStore knows what is meant.
absl::Status CheckJobStore(const std::string& where);

absl::StatusOr<std::unique_ptr<JobStore>> OpenJobStore(const std::string& where, const WrapSqlDatabase& wrap = nullptr);

// Null where one program alone has the store.
std::unique_ptr<StoreNewsChannel> OpenStoreNews(const std::string& where);

}  // namespace meshwright
