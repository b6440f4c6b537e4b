// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include <CLI/CLI.hpp>

namespace meshwright {

// Options of the long-running programs. Each can be given as a flag, as an environment variable (both named by --help)
// or in a configuration file (--config FILE, lines "name = value"), in this order of precedence.

// --scene-root -> MESHWRIGHT_SCENE_ROOT
void NameInEnvironment(CLI::Option* option);
// --metrics-listen
void AddMetricsOption(CLI::App& program, std::string& address);

// Lattices and images are tens of megabytes each. The allocator would keep freed ones for later, after a while, and
// memory would be that of the largest job times the number of threads; so large blocks always go back to the system.
void KeepMemoryLow();

// A file beyond the limit of the shell (ulimit -f) is then an error of that write, as on a full disk, not the end of
// the process.
void IgnoreFileSizeSignal();

// Files and folders made from here on belong to their owner alone (0600, 0700).
void KeepFilesPrivate();

// To be called before any thread is started: SIGINT and SIGTERM are from then on only seen by WaitForStopSignal().
void BlockStopSignals();
int WaitForStopSignal();

}  // namespace meshwright
