// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <absl/time/time.h>

#include "common/base/clock.h"
#include "common/base/mutex.h"
#include "coordinator/auth/access.h"
#include "coordinator/auth/request_rate.h"
#include "coordinator/store/job_store.h"

namespace meshwright {

// Of each user; operators and workers have none.
struct Quotas {
  int64_t reconstructions = 1000;
  int64_t scene_bytes = int64_t{1} << 40;  // uploaded, of all reconstructions together
  double requests_per_second = 200;        // on average; of each address that shows no valid key: a tenth of it
};

// What somebody did or was kept from doing.
struct AuditEvent {
  Caller caller;
  std::string deed;            // the call, e.g. "POST /v1/reconstructions/{id}:start"
  std::string reconstruction;  // "" where it is about none
  absl::Status outcome;        // OK: it was allowed
};

struct GatekeeperOptions {
  // SHA-256 of the keys that the coordinator was started with. Without the operator's nobody has to show a key, and
  // everybody may do everything.
  std::string operator_key_digest;
  std::string worker_key_digest;  // "": workers need a key of their own
  Quotas quotas;
  // Called for all that changes something and for all that is refused, at most some tens of refusals a second.
  std::function<void(const AuditEvent&)> audit = [](const AuditEvent&) {};
  // Called for every refusal.
  std::function<void(const absl::Status&)> count_refusal = [](const absl::Status&) {};
};

// One call, as far as it matters who makes it.
struct Request {
  Action action = Action::kRead;
  std::string deed;
  std::string reconstruction;  // "" where it is about none
};

// What a new key is for.
struct KeyRequest {
  std::string user;
  Role role = Role::kViewer;
  std::string reconstruction;  // not "": a share link
  absl::Duration lifetime = absl::InfiniteDuration();
};
struct NewKey {
  std::string text;  // for its owner, said once and kept nowhere
  AccessToken token;
};

// Asks everybody who comes, over HTTP and gRPC alike, for a key, and says what they may do. Keys are in the store, so
// all coordinators know them, and a revoked one ends at once. Thread-safe.
class Gatekeeper {
 public:
  // Both outlive it.
  Gatekeeper(GatekeeperOptions options, JobStore& store, const Clock& clock);

  // Whether nobody has to show a key.
  bool is_open() const { return options_.operator_key_digest.empty(); }

  // Whose key this is. Unauthenticated for every other: it does not say whether there ever was one like it.
  // ResourceExhausted: too many requests a second.
  absl::StatusOr<Caller> Identify(const std::string& key, const std::string& address);
  // Whether Identify() answers at once, without asking the store.
  bool KnowsAtOnce(const std::string& key) const;
  // Whether the caller may do this. PermissionDenied by role; NotFound for reconstructions of others, in the same words
  // as for those that are not there.
  absl::Status Check(const Caller& caller, const Request& request);
  // Counts and tells a refusal that somebody else found necessary; returns `why`.
  absl::Status Refused(const Caller& caller, const Request& request, absl::Status why);
  // ResourceExhausted where the user has too many already.
  absl::Status CheckReconstructions(const Caller& caller);
  // Counts `bytes` of the file `path` that are on their way as its owner's, until they are released or a week is over.
  // ResourceExhausted where the owner would have too much.
  absl::Status ReserveSceneBytes(const std::string& reconstruction, const std::string& path, int64_t bytes);
  // The same before there is a reconstruction: of the caller, under a name that nobody else uses meanwhile.
  absl::Status ReserveBytes(const Caller& caller, const std::string& name, int64_t bytes);
  // Of one file; with path "": of all. With reconstruction "": what ReserveBytes() has counted under the name `path`.
  void ReleaseSceneBytes(const std::string& reconstruction, const std::string& path = "");

  // Operators make any key, submitters links to what is theirs. InvalidArgument names the field.
  absl::StatusOr<NewKey> Create(const Caller& caller, const KeyRequest& request);
  // Operators see all, others their own.
  absl::StatusOr<std::vector<AccessToken>> List(const Caller& caller);
  absl::Status Revoke(const Caller& caller, const std::string& id);

 private:
  absl::StatusOr<Caller> Find(const std::string& key, const std::string& address);
  absl::Status CheckQuietly(const Caller& caller, const Request& request);
  absl::Status Reserve(const std::string& owner, const std::pair<std::string, std::string>& file, int64_t bytes);

  struct Reserved {
    std::string owner;
    int64_t bytes = 0;
    absl::Time at;
  };

  const GatekeeperOptions options_;
  JobStore& store_;
  const Clock& clock_;
  RequestRate rate_;
  RequestRate rate_without_key_;
  RequestRate refusals_told_;
  Mutex mutex_;
  std::map<std::pair<std::string, std::string>, Reserved> reserved_ ABSL_GUARDED_BY(mutex_);  // by reconstruction, path
};

// In the same words wherever it is said.
absl::Status NoSuchReconstruction(const std::string& id);

}  // namespace meshwright
