// SPDX-License-Identifier: Apache-2.0
#include "coordinator/auth/access.h"

#include <array>
#include <utility>

#include <absl/strings/str_cat.h>

namespace meshwright {
namespace {

constexpr std::array<std::pair<Role, const char*>, 4> kRoles = {{{Role::kViewer, "viewer"},
                                                                 {Role::kSubmitter, "submitter"},
                                                                 {Role::kOperator, "operator"},
                                                                 {Role::kWorker, "worker"}}};

bool RoleMay(const Caller& caller, Action action) {
  if (!caller.only.empty()) return action == Action::kRead;
  if (caller.role == Role::kWorker || action == Action::kWork) {
    return caller.role == Role::kWorker && action == Action::kWork;
  }
  switch (action) {
    case Action::kList:
    case Action::kRead:
      return true;
    case Action::kCreate:
    case Action::kChange:
    case Action::kShare:
      return caller.role != Role::kViewer;
    default:
      return caller.role == Role::kOperator;
  }
}

const char* Deed(Action action) {
  switch (action) {
    case Action::kList:
      return "list reconstructions";
    case Action::kRead:
      return "read reconstructions";
    case Action::kCreate:
      return "create reconstructions";
    case Action::kChange:
      return "change reconstructions";
    case Action::kShare:
      return "share reconstructions";
    case Action::kInspect:
    case Action::kOperate:
      return "operate the service";
    default:
      return "work";
  }
}

}  // namespace

const char* NameOf(Role role) {
  for (const auto& [known, name] : kRoles) {
    if (known == role) return name;
  }
  return "";
}

std::optional<Role> RoleNamed(const std::string& name) {
  for (const auto& [role, known] : kRoles) {
    if (name == known) return role;
  }
  return std::nullopt;
}

absl::Status CheckRole(const Caller& caller, Action action) {
  if (RoleMay(caller, action)) return absl::OkStatus();
  const std::string who = caller.only.empty() ? absl::StrCat("the role ", NameOf(caller.role)) : "a share link";
  return absl::PermissionDeniedError(absl::StrCat(who, " may not ", Deed(action)));
}

bool MaySee(const Caller& caller, const std::string& reconstruction_id, const std::string& owner) {
  if (!caller.only.empty()) return caller.only == reconstruction_id;
  return caller.role == Role::kOperator || (!owner.empty() && caller.user == owner);
}

}  // namespace meshwright
