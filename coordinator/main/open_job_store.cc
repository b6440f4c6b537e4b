#include "coordinator/main/open_job_store.h"

#include <absl/strings/match.h>

#include "coordinator/store/postgres_job_store.h"
#include "coordinator/store/sqlite_job_store.h"

namespace meshwright {
namespace {

constexpr char kSqliteScheme[] = "sqlite:";

}  // namespace

absl::StatusOr<std::unique_ptr<JobStore>> OpenJobStore(const std::string& where, const WrapSqlDatabase& wrap) {
  if (absl::StartsWith(where, kSqliteScheme)) {
    return OpenSqliteJobStore(where.substr(sizeof(kSqliteScheme) - 1), nullptr, wrap);
  }
  if (absl::StartsWith(where, "postgresql://") || absl::StartsWith(where, "postgres://")) {
    return OpenPostgresJobStore(where, {}, wrap);
  }
  return absl::InvalidArgumentError("store: sqlite:PATH or postgresql://USER@HOST:PORT/DATABASE expected");
}

}  // namespace meshwright
