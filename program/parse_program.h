// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <optional>

#include <CLI/CLI.hpp>
#include <absl/status/status.h>

namespace meshwright {

// Parses the command line of a long-running program with what the environment and a file (--config) add, in this order
// of precedence. Settings are the options that NameInEnvironment was called for; unknown ones are wrong use, wherever
// they are said. --version tells the program's name; --check prints what `check` finds wrong with the settings, which
// have been read then. The exit code when that was all: --help, --version, --check, or wrong use, which is printed.
std::optional<int> ParseProgram(CLI::App& program, int argc, char** argv, const std::function<absl::Status()>& check);

}  // namespace meshwright
