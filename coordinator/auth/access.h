// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <absl/status/status.h>

namespace meshwright {

// What a key is for. A viewer reads and a submitter also makes, changes and deletes what is its user's; an operator may
// do everything but a worker's part; a worker does that and nothing else.
enum class Role { kViewer, kSubmitter, kOperator, kWorker };

const char* NameOf(Role role);
// The role of this name, if there is one.
std::optional<Role> RoleNamed(const std::string& name);

// Who makes a call.
struct Caller {
  std::string token_id;  // of the key that was shown; "" where none is asked for
  std::string user;
  Role role = Role::kOperator;
  std::string only;     // a share link: the one reconstruction that it is for; "": all of the user's
  std::string address;  // where the call comes from
  // That the certificate of the connection vouches for; none: it is not known by one.
  std::vector<std::string> certified_names = {};
};

// What calls do.
enum class Action {
  kList,     // what there is, of what the caller may see
  kRead,     // one reconstruction
  kCreate,   // a reconstruction
  kChange,   // one reconstruction: upload, start, cancel, delete
  kShare,    // make and revoke links to what is the caller's
  kInspect,  // see workers
  kOperate,  // drain workers, make and revoke keys
  kWork,     // take jobs and bring results
};

// PermissionDenied unless the caller's role may do this at all.
absl::Status CheckRole(const Caller& caller, Action action);

// Whether this reconstruction, of this owner, is the caller's business. Where it is not, callers are told that it does
// not exist: ids of others are no news.
bool MaySee(const Caller& caller, const std::string& reconstruction_id, const std::string& owner);

}  // namespace meshwright
