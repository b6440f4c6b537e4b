// SPDX-License-Identifier: Apache-2.0
#include "coordinator/main/open_job_store.h"

#include <absl/strings/match.h>

#include "common/base/status_macros.h"
#include "coordinator/store/postgres_job_store.h"
#include "coordinator/store/postgres_news.h"
#include "coordinator/store/sqlite_job_store.h"

namespace meshwright {
namespace {

constexpr char kSqliteScheme[] = "sqlite:";

bool IsSqlite(const std::string& where) { return absl::StartsWith(where, kSqliteScheme); }

bool IsPostgres(const std::string& where) {
  return absl::StartsWith(where, "postgresql://") || absl::StartsWith(where, "postgres://");
}

}  // namespace

absl::Status CheckJobStore(const std::string& where) {
  if (IsSqlite(where) || IsPostgres(where)) return absl::OkStatus();
  // The value may hold a password.
  return absl::InvalidArgumentError("--store: expected sqlite:PATH or postgresql://USER@HOST:PORT/DATABASE");
}

absl::StatusOr<std::unique_ptr<JobStore>> OpenJobStore(const std::string& where, const WrapSqlDatabase& wrap) {
  MW_RETURN_IF_ERROR(CheckJobStore(where));
  if (IsSqlite(where)) {
    return OpenSqliteJobStore(where.substr(sizeof(kSqliteScheme) - 1), nullptr, wrap);
  }
  return OpenPostgresJobStore(where, {}, wrap);
}

std::unique_ptr<StoreNewsChannel> OpenStoreNews(const std::string& where) {
  return IsPostgres(where) ? OpenPostgresNews(where) : nullptr;
}

}  // namespace meshwright
