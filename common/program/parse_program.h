#pragma once

#include <optional>

#include <CLI/CLI.hpp>

namespace meshwright {

// Parses the command line of a long-running program with what the environment and --config add; --version tells the
// program's name. The exit code when that was all: --help, --version, or wrong use, which is printed.
std::optional<int> ParseProgram(CLI::App& program, int argc, char** argv);

}  // namespace meshwright
