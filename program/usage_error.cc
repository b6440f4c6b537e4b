// SPDX-License-Identifier: Apache-2.0
#include "program/usage_error.h"

#include <algorithm>
#include <vector>

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>

#include "common/base/nearest_name.h"

namespace meshwright {
namespace {

constexpr size_t kMostShown = 64;  // characters of what the user wrote

std::vector<std::string> CommandsOf(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::App* const command : app.get_subcommands([](const CLI::App*) { return true; })) {
    names.push_back(command->get_name());
  }
  return names;
}

std::vector<std::string> FlagsOf(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::Option* const option : app.get_options()) {
    for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
  }
  return names;
}

// The command that was chosen; the program itself where none was.
const CLI::App& ChosenCommand(const CLI::App& program) {
  const std::vector<CLI::App*> chosen = program.get_subcommands();
  return chosen.empty() ? program : *chosen.back();
}

}  // namespace

std::string DescribeUsageError(const CLI::App& program, const CLI::ParseError& error) {
  const CLI::App& command = ChosenCommand(program);
  const std::vector<std::string> commands = CommandsOf(command);
  const std::vector<std::string> unknown = program.remaining(/*recurse=*/true);
  const auto flag = std::ranges::find_if(unknown, [](const std::string& word) { return absl::StartsWith(word, "-"); });
  if (flag != unknown.end()) {
    const std::string name = flag->substr(0, flag->find('='));
    return absl::StrCat("there is no option ", name.substr(0, kMostShown), DidYouMean(name, FlagsOf(command)));
  }
  if (!commands.empty() && !unknown.empty()) {
    const std::string& name = unknown.front();
    return absl::StrCat("there is no command ", name.substr(0, kMostShown), DidYouMean(name, commands));
  }
  if (!commands.empty()) return absl::StrCat("a command is expected: ", absl::StrJoin(commands, ", "));
  return error.what();
}

}  // namespace meshwright
