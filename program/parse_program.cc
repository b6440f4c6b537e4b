// SPDX-License-Identifier: Apache-2.0
#include "program/parse_program.h"

#include <algorithm>
#include <cstdio>
#include <map>
#include <set>
#include <string>
#include <vector>

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>

#include "program/console.h"
#include "program/environment.h"
#include "program/program_options.h"
#include "program/settings_file.h"
#include "program/usage_error.h"

#include "common/base/files.h"
#include "common/base/nearest_name.h"
#include "common/base/status_macros.h"
#include "common/base/version.h"

namespace meshwright {
namespace {

constexpr char kConfig[] = "config";
constexpr char kSeeHelp[] = " (--help shows what is expected)";

// The value of --config among the arguments; "": it is not there.
std::string ConfigOf(const std::vector<std::string>& arguments) {
  const std::string flag = absl::StrCat("--", kConfig);
  for (size_t i = 0; i < arguments.size(); ++i) {
    if (absl::StartsWith(arguments[i], flag + "=")) return arguments[i].substr(flag.size() + 1);
    if (arguments[i] == flag && i + 1 < arguments.size()) return arguments[i + 1];
  }
  return "";
}

bool IsGiven(const std::vector<std::string>& arguments, const std::string& name) {
  const std::string flag = absl::StrCat("--", name);
  return std::ranges::any_of(arguments, [&](const std::string& argument) {
    return argument == flag || absl::StartsWith(argument, flag + "=");
  });
}

// The command line with what the environment and the file say and it does not.
class CompletedArguments {
 public:
  CompletedArguments(const CLI::App& program, std::vector<std::string> arguments) : arguments_(std::move(arguments)) {
    for (const CLI::Option* const option : program.get_options()) {
      if (option->get_envname().empty()) continue;
      names_.push_back(option->get_single_name());
      if (option->get_items_expected_max() > 1) repeatable_.insert(option->get_single_name());
    }
  }

  absl::Status Complete() {
    MW_ASSIGN_OR_RETURN(const std::vector<Setting> environment, SettingsOfEnvironment(names_));
    std::string config = ConfigOf(arguments_);
    for (const Setting& setting : environment) {
      if (config.empty() && setting.name == kConfig) config = setting.value;
    }
    std::vector<Setting> file;
    if (!config.empty()) {
      MW_ASSIGN_OR_RETURN(const std::string text, ReadFile(config));
      MW_ASSIGN_OR_RETURN(file, ParseSettingsFile(config, text));
      MW_RETURN_IF_ERROR(CheckFile(file));
    }
    Add(environment);
    Add(file);
    return absl::OkStatus();
  }

  const std::vector<std::string>& arguments() const { return arguments_; }
  // " (in /etc/worker.conf:3)" behind a message that begins with a setting which was not given on the command line.
  std::string SourceOf(const std::string& message) const {
    for (const auto& [name, source] : sources_) {
      const std::string flag = absl::StrCat("--", name);
      if (absl::StartsWith(message, flag + ":") || absl::StartsWith(message, flag + " ")) {
        return absl::StrCat(" (in ", source, ")");
      }
    }
    return "";
  }

 private:
  absl::Status CheckFile(const std::vector<Setting>& file) const {
    std::set<std::string> seen;
    for (const Setting& setting : file) {
      const bool is_known = setting.name != kConfig && std::ranges::count(names_, setting.name) > 0;
      if (!is_known) {
        return absl::InvalidArgumentError(absl::StrCat(setting.source, ": there is no setting ",
                                                       setting.name.substr(0, 64), DidYouMean(setting.name, names_)));
      }
      if (!seen.insert(setting.name).second && repeatable_.count(setting.name) == 0) {
        return absl::InvalidArgumentError(absl::StrCat(setting.source, ": ", setting.name, " is set a second time"));
      }
    }
    return absl::OkStatus();
  }

  void Add(const std::vector<Setting>& settings) {
    const std::vector<std::string> before = arguments_;
    for (const Setting& setting : settings) {
      if (IsGiven(before, setting.name)) continue;
      arguments_.push_back(absl::StrCat("--", setting.name, "=", setting.value));
      sources_[setting.name] = setting.source;
    }
  }

  std::vector<std::string> arguments_;
  std::vector<std::string> names_;
  std::set<std::string> repeatable_;
  std::map<std::string, std::string> sources_;
};

}  // namespace

std::optional<int> ParseProgram(CLI::App& program, int argc, char** argv, const std::function<absl::Status()>& check) {
  program.set_version_flag("--version", absl::StrCat(program.get_name(), " ", kProgramVersion));
  std::string config;
  bool check_only = false;
  NameInEnvironment(
      program.add_option(absl::StrCat("--", kConfig), config, "file with lines \"name = value\", e.g. cores = 4"));
  program.add_flag("--check", check_only, "say whether the settings are good, and end");
  CompletedArguments completed(program, {argv + std::min(argc, 1), argv + argc});
  const bool asks = std::ranges::count(completed.arguments(), "-h") > 0 || IsGiven(completed.arguments(), "help") ||
                    IsGiven(completed.arguments(), "version");
  if (!asks) {
    if (const absl::Status status = completed.Complete(); !status.ok()) {
      return FailWrongUse(std::string(status.message()));
    }
  }
  try {
    std::vector<std::string> arguments = completed.arguments();
    std::reverse(arguments.begin(), arguments.end());  // as CLI11 wants them
    program.parse(arguments);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return program.exit(error);
    const std::string message = DescribeUsageError(program, error);
    return FailWrongUse(absl::StrCat(message, completed.SourceOf(message), kSeeHelp));
  }
  if (const absl::Status checked = check(); !checked.ok()) {
    const std::string message(checked.message());
    return FailWrongUse(absl::StrCat(message, completed.SourceOf(message)));
  }
  if (!check_only) return std::nullopt;
  std::printf("the settings of %s are good\n", program.get_name().c_str());
  return kExitDone;
}

}  // namespace meshwright
