// SPDX-License-Identifier: Apache-2.0
#include "coordinator/auth/gatekeeper.h"

#include <optional>
#include <utility>

#include <absl/strings/str_cat.h>

#include "common/base/digest.h"
#include "common/base/status_macros.h"
#include "coordinator/auth/token_text.h"

namespace meshwright {
namespace {

constexpr char kOperatorKey[] = "api-token-file";
constexpr char kWorkerKey[] = "worker-token-file";
constexpr double kRefusalsToldPerSecond = 10;
constexpr size_t kMaxUserLength = 64;
constexpr size_t kMaxTokens = 100'000;
constexpr size_t kMaxUnfinishedFiles = 10'000;
constexpr absl::Duration kReservation = absl::Hours(24 * 7);  // as long as unfinished uploads are kept
// Keys stay in the list so long after their end, so that the audit log can be understood.
constexpr absl::Duration kRememberDeadKeys = absl::Hours(24 * 90);

absl::Status Unknown() {
  return absl::UnauthenticatedError("a valid key is missing, expected Authorization: Bearer and the key");
}

bool ChangesSomething(Action action) {
  return action == Action::kCreate || action == Action::kChange || action == Action::kShare ||
         action == Action::kOperate;
}

absl::Status CheckUser(const std::string& user) {
  constexpr char kLetters[] = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789._@+-";
  if (!user.empty() && user.size() <= kMaxUserLength && user.find_first_not_of(kLetters) == std::string::npos) {
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError(
      absl::StrCat("user: expected 1 to ", kMaxUserLength,
                   " of the characters a-z, A-Z, 0-9, \".\", \"_\", \"@\", \"+\" and \"-\""));
}

}  // namespace

absl::Status NoSuchReconstruction(const std::string& id) {
  return absl::NotFoundError(absl::StrCat("there is no reconstruction \"", id.substr(0, 64), "\""));
}

Gatekeeper::Gatekeeper(GatekeeperOptions options, JobStore& store, const Clock& clock)
    : options_(std::move(options)),
      store_(store),
      clock_(clock),
      rate_(options_.quotas.requests_per_second),
      rate_without_key_(options_.quotas.requests_per_second / 10),
      refusals_told_(kRefusalsToldPerSecond) {}

absl::Status Gatekeeper::Refused(const Caller& caller, const Request& request, absl::Status why) {
  options_.count_refusal(why);
  if (refusals_told_.Take("", clock_.Now())) {
    options_.audit({.caller = caller, .deed = request.deed, .reconstruction = request.reconstruction, .outcome = why});
  }
  return why;
}

absl::StatusOr<Caller> Gatekeeper::Identify(const std::string& key, const std::string& address) {
  if (is_open()) return Caller{.role = Role::kOperator, .address = address};
  absl::StatusOr<Caller> caller = Find(key, address);
  const bool is_known = caller.ok();
  if (!is_known && !absl::IsUnauthenticated(caller.status())) return caller.status();  // the store is away
  const bool is_limited = !is_known || caller->role == Role::kViewer || caller->role == Role::kSubmitter;
  RequestRate& rate = is_known ? rate_ : rate_without_key_;
  if (is_limited && !rate.Take(is_known ? caller->user : address, clock_.Now())) {
    caller = absl::ResourceExhaustedError("too many requests a second");
  }
  if (caller.ok()) return caller;
  return Refused({.user = "", .role = Role::kViewer, .address = address}, {.deed = "identify"}, caller.status());
}

bool Gatekeeper::KnowsAtOnce(const std::string& key) const {
  return is_open() || EqualInConstantTime(Sha256Hex(key), options_.operator_key_digest);
}

absl::StatusOr<Caller> Gatekeeper::Find(const std::string& key, const std::string& address) {
  const std::string digest = Sha256Hex(key);
  if (EqualInConstantTime(digest, options_.operator_key_digest)) {
    return Caller{.token_id = kOperatorKey, .user = "operator", .role = Role::kOperator, .address = address};
  }
  if (!options_.worker_key_digest.empty() && EqualInConstantTime(digest, options_.worker_key_digest)) {
    return Caller{.token_id = kWorkerKey, .user = "worker", .role = Role::kWorker, .address = address};
  }
  const std::optional<TokenText> text = ParseToken(key);
  if (!text) return Unknown();
  const absl::StatusOr<AccessToken> token = store_.GetToken(text->id);
  if (absl::IsNotFound(token.status())) return Unknown();
  MW_RETURN_IF_ERROR(token.status());
  const bool is_right = EqualInConstantTime(Sha256Hex(text->secret), token->digest);
  const absl::Time now = clock_.Now();
  const std::optional<Role> role = RoleNamed(token->role);
  if (!is_right || token->revoked_at <= now || token->expires_at <= now || !role) return Unknown();
  return Caller{
      .token_id = token->id, .user = token->user, .role = *role, .only = token->reconstruction_id, .address = address};
}

absl::Status Gatekeeper::Check(const Caller& caller, const Request& request) {
  if (!is_open()) {
    const absl::Status allowed = CheckQuietly(caller, request);
    if (!allowed.ok()) return Refused(caller, request, allowed);
  }
  if (ChangesSomething(request.action)) {
    options_.audit({.caller = caller, .deed = request.deed, .reconstruction = request.reconstruction});
  }
  return absl::OkStatus();
}

absl::Status Gatekeeper::CheckQuietly(const Caller& caller, const Request& request) {
  MW_RETURN_IF_ERROR(CheckRole(caller, request.action));
  if (request.reconstruction.empty() || request.action == Action::kCreate) return absl::OkStatus();
  if (caller.only.empty() && caller.role == Role::kOperator) return absl::OkStatus();
  const absl::StatusOr<Reconstruction> stored = store_.GetReconstruction(request.reconstruction);
  if (absl::IsNotFound(stored.status())) return NoSuchReconstruction(request.reconstruction);
  MW_RETURN_IF_ERROR(stored.status());
  return MaySee(caller, stored->id, stored->owner) ? absl::OkStatus() : NoSuchReconstruction(request.reconstruction);
}

absl::Status Gatekeeper::CheckReconstructions(const Caller& caller) {
  if (is_open() || caller.role == Role::kOperator) return absl::OkStatus();
  MW_ASSIGN_OR_RETURN(const Usage usage, store_.UsageOf(caller.user));
  if (usage.reconstructions < options_.quotas.reconstructions) return absl::OkStatus();
  return absl::ResourceExhaustedError(absl::StrCat("user ", caller.user, " has ", usage.reconstructions,
                                                   " reconstructions, allowed are ", options_.quotas.reconstructions));
}

absl::Status Gatekeeper::ReserveSceneBytes(const std::string& reconstruction, const std::string& path, int64_t bytes) {
  if (is_open()) return absl::OkStatus();
  const absl::StatusOr<Reconstruction> stored = store_.GetReconstruction(reconstruction);
  if (absl::IsNotFound(stored.status())) return absl::OkStatus();  // others say so
  MW_RETURN_IF_ERROR(stored.status());
  return stored->owner.empty() ? absl::OkStatus() : Reserve(stored->owner, {reconstruction, path}, bytes);
}

absl::Status Gatekeeper::ReserveBytes(const Caller& caller, const std::string& name, int64_t bytes) {
  if (is_open() || caller.role == Role::kOperator) return absl::OkStatus();
  return Reserve(caller.user, {"", name}, bytes);
}

absl::Status Gatekeeper::Reserve(const std::string& owner, const std::pair<std::string, std::string>& file,
                                 int64_t bytes) {
  MW_ASSIGN_OR_RETURN(const Usage usage, store_.UsageOf(owner));
  const absl::Time now = clock_.Now();
  const MutexLock lock(mutex_);
  std::erase_if(reserved_, [&](const auto& entry) { return now - entry.second.at > kReservation; });
  int64_t on_their_way = bytes;
  size_t files = 0;
  for (const auto& [other_file, other] : reserved_) {
    if (other.owner != owner || other_file == file) continue;
    on_their_way += other.bytes;
    ++files;
  }
  if (files >= kMaxUnfinishedFiles) {
    return absl::ResourceExhaustedError(absl::StrCat("user ", owner, " has ", files, " files on their way already"));
  }
  if (usage.scene_bytes > options_.quotas.scene_bytes - on_their_way) {
    return absl::ResourceExhaustedError(absl::StrCat("user ", owner, " has uploaded ", usage.scene_bytes,
                                                     " bytes and would have ", on_their_way,
                                                     " on their way, allowed are ", options_.quotas.scene_bytes));
  }
  reserved_[file] = {.owner = owner, .bytes = bytes, .at = now};
  return absl::OkStatus();
}

void Gatekeeper::ReleaseSceneBytes(const std::string& reconstruction, const std::string& path) {
  const MutexLock lock(mutex_);
  std::erase_if(reserved_, [&](const auto& entry) {
    return entry.first.first == reconstruction && (path.empty() || entry.first.second == path);
  });
}

absl::StatusOr<NewKey> Gatekeeper::Create(const Caller& caller, const KeyRequest& request) {
  const bool is_link = !request.reconstruction.empty();
  MW_RETURN_IF_ERROR(Check(caller, {.action = is_link ? Action::kShare : Action::kOperate,
                                    .deed = is_link ? "create share link" : "create key",
                                    .reconstruction = request.reconstruction}));
  const std::string user = is_link ? caller.user : request.user;
  MW_RETURN_IF_ERROR(is_link && user.empty() ? absl::OkStatus() : CheckUser(user));
  if (is_link && request.role != Role::kViewer) {
    return absl::InvalidArgumentError("role: expected viewer for a share link");
  }
  if (is_link) {
    const absl::StatusOr<Reconstruction> stored = store_.GetReconstruction(request.reconstruction);
    if (absl::IsNotFound(stored.status())) return NoSuchReconstruction(request.reconstruction);
    MW_RETURN_IF_ERROR(stored.status());
  }
  if (request.lifetime <= absl::ZeroDuration()) {
    return absl::InvalidArgumentError("lifetime: expected more than 0 s");
  }
  const absl::Time now = clock_.Now();
  MW_RETURN_IF_ERROR(store_.RemoveDeadTokens(now - kRememberDeadKeys));
  MW_ASSIGN_OR_RETURN(const std::vector<AccessToken> all, store_.ListTokens());
  if (all.size() >= kMaxTokens) return absl::ResourceExhaustedError(absl::StrCat("there are ", kMaxTokens, " keys"));
  const TokenText text = NewToken();
  NewKey key = {.text = text.Text(),
                .token = {.id = text.id,
                          .digest = Sha256Hex(text.secret),
                          .user = user.empty() ? "operator" : user,
                          .role = NameOf(request.role),
                          .reconstruction_id = request.reconstruction,
                          .created_at = absl::FromUnixMicros(absl::ToUnixMicros(now)),
                          .expires_at = now + request.lifetime}};
  MW_RETURN_IF_ERROR(store_.CreateToken(key.token));
  return key;
}

absl::StatusOr<std::vector<AccessToken>> Gatekeeper::List(const Caller& caller) {
  if (!is_open()) MW_RETURN_IF_ERROR(CheckRole(caller, Action::kList));
  MW_ASSIGN_OR_RETURN(std::vector<AccessToken> all, store_.ListTokens());
  if (caller.role != Role::kOperator) {
    std::erase_if(all, [&](const AccessToken& token) { return token.user != caller.user; });
  }
  return all;
}

absl::Status Gatekeeper::Revoke(const Caller& caller, const std::string& id) {
  MW_RETURN_IF_ERROR(Check(caller, {.action = Action::kShare, .deed = absl::StrCat("revoke key ", id.substr(0, 16))}));
  const absl::Status none = absl::NotFoundError(absl::StrCat("there is no key \"", id.substr(0, 32), "\""));
  const absl::StatusOr<AccessToken> token = store_.GetToken(id);
  if (absl::IsNotFound(token.status())) return none;
  MW_RETURN_IF_ERROR(token.status());
  if (caller.role != Role::kOperator && token->user != caller.user) return none;
  return store_.RevokeToken(id, clock_.Now());
}

}  // namespace meshwright
