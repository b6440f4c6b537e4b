// SPDX-License-Identifier: Apache-2.0
// Who may what: keys, owners and what they have.
#include <absl/strings/str_cat.h>

#include "common/base/status_macros.h"
#include "coordinator/store/sql_job_store.h"

namespace meshwright {
namespace {

SqlValue NullIfNever(absl::Time time) {
  return time == absl::InfiniteFuture() ? SqlValue(std::nullopt) : SqlValue(absl::ToUnixMicros(time));
}

AccessToken ReadToken(const SqlRow& row) {
  AccessToken token = {.id = row.Text(0),
                       .digest = row.Text(1),
                       .user = row.Text(2),
                       .role = row.Text(3),
                       .reconstruction_id = row.Text(4),
                       .created_at = row.Time(5)};
  if (!row.IsNull(6)) token.expires_at = row.Time(6);
  if (!row.IsNull(7)) token.revoked_at = row.Time(7);
  return token;
}

}  // namespace

absl::StatusOr<Usage> SqlJobStore::UsageOf(const std::string& owner) {
  MW_ASSIGN_OR_RETURN(const SqlResult result, database_->Run("usage_of", {{"owner", owner}}));
  return Usage{.reconstructions = result.rows.front().Integer(0), .scene_bytes = result.rows.front().Integer(1)};
}

absl::Status SqlJobStore::CreateToken(const AccessToken& token) {
  return database_
      ->Run("create_token", {{"id", token.id},
                             {"digest", token.digest},
                             {"user_name", token.user},
                             {"role", token.role},
                             {"reconstruction_id", token.reconstruction_id},
                             {"created_at", absl::ToUnixMicros(token.created_at)},
                             {"expires_at", NullIfNever(token.expires_at)}})
      .status();
}

absl::StatusOr<AccessToken> SqlJobStore::GetToken(const std::string& id) {
  MW_ASSIGN_OR_RETURN(const SqlResult result, database_->Run("get_token", {{"id", id}}));
  if (result.rows.empty()) return absl::NotFoundError(absl::StrCat("no token ", id));
  return ReadToken(result.rows.front());
}

absl::StatusOr<std::vector<AccessToken>> SqlJobStore::ListTokens() {
  MW_ASSIGN_OR_RETURN(const SqlResult result, database_->Run("list_tokens", {}));
  std::vector<AccessToken> tokens;
  tokens.reserve(result.rows.size());
  for (const SqlRow& row : result.rows) tokens.push_back(ReadToken(row));
  return tokens;
}

absl::Status SqlJobStore::RevokeToken(const std::string& id, absl::Time now) {
  MW_ASSIGN_OR_RETURN(const SqlResult result,
                      database_->Run("revoke_token", {{"id", id}, {"now", absl::ToUnixMicros(now)}}));
  return result.changed > 0 ? absl::OkStatus() : absl::NotFoundError(absl::StrCat("no token ", id));
}

absl::Status SqlJobStore::RemoveDeadTokens(absl::Time before) {
  return database_->Run("remove_dead_tokens", {{"before", absl::ToUnixMicros(before)}}).status();
}

}  // namespace meshwright
