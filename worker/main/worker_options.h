// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <CLI/CLI.hpp>

#include "worker/main/worker_program.h"

namespace meshwright {

// All settings of meshwright-worker.
void AddWorkerOptions(CLI::App& program, WorkerSettings& settings);

}  // namespace meshwright
