// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cstdio>
#include <optional>
#include <thread>

#include "program/console.h"
#include "program/parse_program.h"
#include "program/program_options.h"

#include "coordinator/main/coordinator_options.h"

namespace {

constexpr double kShutdownSeconds = 5;

int Serve(const meshwright::CoordinatorSettings& settings) {
  const auto program = meshwright::CoordinatorProgram::Start(settings);
  if (!program.ok()) return meshwright::Fail(program.status());
  std::printf("listening on port %d\n", (*program)->port());
  if (const int port = (*program)->rest_port(); port > 0) std::printf("HTTP on port %d\n", port);
  if (const int port = (*program)->nodeodm_port(); port > 0) std::printf("NodeODM on port %d\n", port);
  if (const int port = (*program)->metrics_port(); port > 0) std::printf("metrics on port %d\n", port);
  std::fflush(stdout);
  meshwright::WaitForStopSignal();
  (*program)->Shutdown(absl::Seconds(kShutdownSeconds));
  return meshwright::kExitDone;
}

}  // namespace

int main(int argc, char** argv) {
  using namespace meshwright;
  KeepMemoryLow();
  IgnoreFileSizeSignal();
  BlockStopSignals();
  CLI::App program("Meshwright's coordinator: decides which camera is processed next, accepts surfaces, makes meshes.",
                   "meshwright-coordinator");
  CoordinatorSettings settings;
  settings.threads = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  AddCoordinatorOptions(program, settings);
  const auto check = [&] { return CoordinatorProgram::Check(settings); };
  if (const std::optional<int> over = ParseProgram(program, argc, argv, check)) return *over;
  // Blobs elsewhere are for workers too, who may be other users.
  if (settings.blobs.empty()) KeepFilesPrivate();
  return Serve(settings);
}
