// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include <CLI/CLI.hpp>

namespace meshwright {

// What is wrong with a command line that could not be parsed, in one line. A command or option that does not exist is
// named first, with the nearest one: other complaints mostly follow from it.
std::string DescribeUsageError(const CLI::App& program, const CLI::ParseError& error);

}  // namespace meshwright
