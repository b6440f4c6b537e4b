// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <CLI/CLI.hpp>

#include "coordinator/main/coordinator_program.h"

namespace meshwright {

// All settings of meshwright-coordinator.
void AddCoordinatorOptions(CLI::App& program, CoordinatorSettings& settings);
// --rest-listen and what belongs to it; AddCoordinatorOptions has them.
void AddRestOptions(CLI::App& program, CoordinatorSettings& settings);
// Keys, TLS of gRPC and what one user may have; AddRestOptions has them.
void AddAccessOptions(CLI::App& program, CoordinatorSettings& settings);

}  // namespace meshwright
