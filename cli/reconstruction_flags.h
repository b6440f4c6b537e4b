// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <CLI/CLI.hpp>

#include "pipeline/options/reconstruction_options.h"

namespace meshwright {

// --preset, and --lattice-step and all others of the option table, each checked as it is read. What they ask of each
// other is left to CheckOptions, when all are known.
void AddReconstructionFlags(CLI::App& command, ReconstructionOptions& options);

}  // namespace meshwright
