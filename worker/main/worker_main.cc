// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cstdio>
#include <optional>
#include <thread>

#include <unistd.h>

#include "program/console.h"
#include "program/parse_program.h"
#include "program/program_options.h"

#include "worker/main/worker_keeper.h"
#include "worker/main/worker_options.h"

namespace {

int Work(const meshwright::WorkerSettings& settings) {
  const auto worker = meshwright::WorkerProgram::Make(settings);
  if (!worker.ok()) return meshwright::Fail(worker.status());
  if (const int port = (*worker)->metrics_port(); port > 0) {
    std::printf("metrics on port %d\n", port);
    std::fflush(stdout);
  }
  std::thread([&] {
    meshwright::WaitForStopSignal();
    (*worker)->Drain();
  }).detach();
  (*worker)->Run();
  // Jobs that were released may still run: nobody waits for them.
  std::fflush(nullptr);
  ::_exit(meshwright::kExitDone);
}

}  // namespace

int main(int argc, char** argv) {
  using namespace meshwright;
  KeepMemoryLow();
  IgnoreFileSizeSignal();
  BlockStopSignals();
  CLI::App program("Meshwright's worker: processes reference cameras for a coordinator.", "meshwright-worker");
  WorkerSettings settings;
  settings.cores = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  AddWorkerOptions(program, settings);
  if (const std::optional<int> over = ParseProgram(program, argc, argv, [&] { return WorkerProgram::Check(settings); }))
    return *over;
  if (settings.id.empty()) settings.id = DefaultWorkerId();
  return KeepAlive([&](bool ran_out_of_memory) {
    settings.ran_out_of_memory = ran_out_of_memory;
    return Work(settings);
  });
}
