// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <thread>
#include <vector>

#include <absl/strings/str_cat.h>
#include <unistd.h>

#include "program/program_options.h"

#include "cli/commands.h"
#include "common/base/host_port.h"
#include "coordinator/main/coordinator_options.h"
#include "coordinator/main/key_file.h"
#include "worker/main/worker_program.h"

namespace meshwright {
namespace {

constexpr char kExamples[] = R"(Examples:
  meshwright up --data service
  meshwright up --data service --workers 4 --listen 0.0.0.0:7420 --api-token-file key
Then, from another terminal: meshwright submit my-scene -o mesh.ply
More workers may join from other machines: meshwright-worker --coordinator HOST:7420)";

constexpr double kShutdownSeconds = 5;

struct Arguments {
  CoordinatorSettings coordinator;
  int workers = 1;
};

// Where this machine reaches what listens at `listen`: all addresses (0.0.0.0, [::]) include the loopback one, and
// every other is reached by itself.
std::string OwnAddress(const HostPort& listen, int port) {
  HostPort own = {.host = listen.host, .port = port};
  if (own.host == "0.0.0.0") own.host = "127.0.0.1";
  if (own.host == "::") own.host = "::1";
  return ToString(own);
}

// Where callers have to show a key, the workers here need one too.
absl::Status MakeWorkerKey(CoordinatorSettings& settings) {
  if (settings.api_token_file.empty() || !settings.worker_token_file.empty()) return absl::OkStatus();
  std::error_code error;
  std::filesystem::create_directories(settings.data_folder, error);
  settings.worker_token_file = settings.data_folder + "/worker-key";
  return MakeKeyFile(settings.worker_token_file);
}

int Up(Arguments& arguments) {
  BlockStopSignals();
  CoordinatorSettings& settings = arguments.coordinator;
  settings.threads = AvailableCores();
  KeepFilesPrivate();
  if (settings.blobs.empty()) settings.blobs = settings.data_folder + "/blobs";
  const absl::StatusOr<HostPort> listen = ParseHostPort(settings.listen, "--listen");
  if (!listen.ok()) return FailWrongUse(std::string(listen.status().message()));
  if (const absl::Status made = MakeWorkerKey(settings); !made.ok()) return Fail(made);
  const auto coordinator = CoordinatorProgram::Start(settings);
  if (!coordinator.ok()) return Fail(coordinator.status());
  std::vector<std::unique_ptr<WorkerProgram>> workers;
  std::vector<std::thread> threads;
  for (int i = 0; i < arguments.workers; ++i) {
    auto worker = WorkerProgram::Make({.coordinator = OwnAddress(*listen, (*coordinator)->port()),
                                       .id = absl::StrCat("local-", i + 1),
                                       .blobs = settings.blobs,
                                       .token_file = settings.worker_token_file,
                                       .ca_file = settings.tls_certificate_file,
                                       .cores = std::max(1, AvailableCores() / arguments.workers),
                                       .drain_seconds = 0});
    if (!worker.ok()) return Fail(worker.status());
    workers.push_back(*std::move(worker));
  }
  for (const auto& worker : workers) threads.emplace_back([&worker] { worker->Run(); });
  std::printf("listening on port %d\n", (*coordinator)->port());
  if (const int port = (*coordinator)->rest_port(); port > 0) {
    std::printf("the dashboard is at http://127.0.0.1:%d/\n", port);
  }
  if (const int port = (*coordinator)->nodeodm_port(); port > 0) std::printf("NodeODM on port %d\n", port);
  std::fflush(stdout);
  WaitForStopSignal();
  // Jobs that run are lost; whoever starts this again goes on from the last commit.
  for (const auto& worker : workers) worker->Drain();
  for (std::thread& thread : threads) thread.join();
  (*coordinator)->Shutdown(absl::Seconds(kShutdownSeconds));
  std::fflush(nullptr);
  ::_exit(kExitDone);
}

}  // namespace

void AddUpCommand(CLI::App& program, Run& run) {
  auto arguments = std::make_shared<Arguments>();
  arguments->coordinator.data_folder = "meshwright-data";
  arguments->coordinator.rest_listen = "127.0.0.1:7421";
  CLI::App& command = *program.add_subcommand("up", "Run a coordinator and workers on this machine");
  command.footer(kExamples);
  CoordinatorSettings& settings = arguments->coordinator;
  NameInEnvironment(
      command.add_option("--listen", settings.listen, "host:port for workers and clients")->capture_default_str());
  NameInEnvironment(
      command.add_option("--data", settings.data_folder, "folder for everything that is kept")->capture_default_str());
  NameInEnvironment(
      command.add_option("--scene-root", settings.scene_roots, "folders that scenes may be taken from by reference")
          ->delimiter(':'));
  AddRestOptions(command, settings);
  command.add_option("--workers", arguments->workers, "that share the cores of this machine")
      ->check(CLI::Range(1, 256))
      ->capture_default_str();
  command.callback([arguments, &run] { run = [arguments] { return Up(*arguments); }; });
}

}  // namespace meshwright
