// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cstdio>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <absl/strings/ascii.h>
#include <absl/strings/str_cat.h>
#include <absl/time/time.h>

#include "cli/commands.h"
#include "cli/service_arguments.h"

namespace meshwright {
namespace {

using Json = nlohmann::ordered_json;

constexpr char kExamples[] = R"(Examples:
  meshwright token create --user alice --role submitter --expires 90d > alice.key
  meshwright token create --share my-scene --expires 7d    # a link: reads this one reconstruction
  meshwright token list
  meshwright token revoke 5f0c2b7a91d3e864)";

constexpr char kRolePrefix[] = "ROLE_";

struct Arguments {
  ServiceArguments service;
  std::string user;
  std::string role = "submitter";
  std::string share;
  std::string expires;
  std::string id;
};

std::string NameOf(v1::Role role) { return absl::AsciiStrToLower(v1::Role_Name(role).substr(sizeof(kRolePrefix) - 1)); }

// "90d", "12h", "30m"
absl::StatusOr<int64_t> SecondsOf(const std::string& text) {
  constexpr std::pair<char, int64_t> kUnits[] = {{'d', 86400}, {'h', 3600}, {'m', 60}};
  for (const auto& [unit, seconds] : kUnits) {
    if (text.size() < 2 || text.size() > 7 || text.back() != unit) continue;
    const std::string digits = text.substr(0, text.size() - 1);
    if (digits.find_first_not_of("0123456789") != std::string::npos) continue;
    if (const int64_t count = std::stoll(digits); count > 0) return count * seconds;
  }
  return absl::InvalidArgumentError(absl::StrCat("--expires is \"", text, "\", expected a number with d, h or m: 90d"));
}

Json ToJson(const v1::Key& key) {
  const auto time = [](const google::protobuf::Timestamp& at) {
    return absl::FormatTime(absl::RFC3339_sec, absl::FromUnixSeconds(at.seconds()), absl::UTCTimeZone());
  };
  Json json = {{"id", key.id()}, {"user", key.user()}, {"role", NameOf(key.role())}};
  if (!key.reconstruction_id().empty()) json["share"] = key.reconstruction_id();
  json["created"] = time(key.create_time());
  if (key.has_expire_time()) json["expires"] = time(key.expire_time());
  if (key.has_revoke_time()) json["revoked"] = time(key.revoke_time());
  return json;
}

int Create(const Arguments& arguments) {
  v1::CreateKeyRequest request;
  v1::Role role = v1::ROLE_UNSPECIFIED;
  if (!v1::Role_Parse(absl::StrCat(kRolePrefix, absl::AsciiStrToUpper(arguments.role)), &role)) {
    return FailWrongUse(absl::StrCat("--role is ", arguments.role, ", expected viewer, submitter, operator or worker"));
  }
  if (arguments.share.empty() == arguments.user.empty()) return FailWrongUse("expected --user NAME or --share ID");
  request.set_user(arguments.user);
  request.set_role(arguments.share.empty() ? role : v1::ROLE_VIEWER);
  request.set_reconstruction_id(arguments.share);
  if (!arguments.expires.empty()) {
    const absl::StatusOr<int64_t> seconds = SecondsOf(arguments.expires);
    if (!seconds.ok()) return FailWrongUse(std::string(seconds.status().message()));
    request.mutable_lifetime()->set_seconds(*seconds);
  }
  const absl::StatusOr<v1::CreateKeyResponse> created = arguments.service.Connect()->CreateKey(request);
  if (!created.ok()) return FailCall(created.status(), arguments.service);
  if (arguments.service.output.json) {
    Json json = ToJson(created->key());
    json["token"] = created->text();
    PrintJson(json);
  } else {
    std::printf("%s\n", created->text().c_str());
    std::fprintf(stderr, "key %s; it is kept nowhere and cannot be shown again\n", created->key().id().c_str());
  }
  return kExitDone;
}

int List(const Arguments& arguments) {
  const absl::StatusOr<v1::ListKeysResponse> keys = arguments.service.Connect()->ListKeys();
  if (!keys.ok()) return FailCall(keys.status(), arguments.service);
  Json all = Json::array();
  for (const v1::Key& key : keys->keys()) {
    const Json json = ToJson(key);
    all.push_back(json);
    if (arguments.service.output.json) continue;
    const char* const end = key.has_revoke_time() ? "revoked" : "expires";
    std::printf("%-16s %-20s %-10s%s%s\n", key.id().c_str(), key.user().c_str(), NameOf(key.role()).c_str(),
                key.reconstruction_id().empty() ? "" : absl::StrCat(" only ", key.reconstruction_id()).c_str(),
                json.contains(end) ? absl::StrCat(" ", end, " ", json[end].get<std::string>()).c_str() : "");
  }
  if (arguments.service.output.json) PrintJson({{"keys", std::move(all)}});
  return kExitDone;
}

int Revoke(const Arguments& arguments) {
  const absl::Status status = arguments.service.Connect()->RevokeKey(arguments.id);
  return status.ok() ? kExitDone : FailCall(status, arguments.service);
}

}  // namespace

void AddTokenCommand(CLI::App& program, Run& run) {
  CLI::App& command = *program.add_subcommand("token", "Make, list and revoke keys to a coordinator");
  command.footer(kExamples);
  command.require_subcommand(1);
  const auto add = [&](const char* name, const char* description, int (*what)(const Arguments&)) {
    auto arguments = std::make_shared<Arguments>();
    CLI::App& subcommand = *command.add_subcommand(name, description);
    AddServiceOptions(subcommand, arguments->service);
    subcommand.callback([arguments, what, &run] { run = [arguments, what] { return what(*arguments); }; });
    return std::pair<CLI::App*, std::shared_ptr<Arguments>>(&subcommand, arguments);
  };
  const auto [create, made] = add("create", "Make a key; it is printed once", Create);
  create->add_option("--user", made->user, "whose it is");
  create->add_option("--role", made->role, "viewer, submitter, operator or worker")->capture_default_str();
  create->add_option("--share", made->share, "instead of --user: a link that reads this one reconstruction");
  create->add_option("--expires", made->expires, "after so long, e.g. 90d, 12h [never]");
  add("list", "Show the keys that there are, without their secrets", List);
  const auto [revoke, revoked] = add("revoke", "End a key at once", Revoke);
  revoke->add_option("ID", revoked->id, "as \"token list\" shows it")->required();
}

}  // namespace meshwright
