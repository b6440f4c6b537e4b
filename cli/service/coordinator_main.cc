#include <algorithm>
#include <cstdio>
#include <thread>

#include <absl/strings/str_cat.h>

#include "cli/console.h"
#include "cli/service/program_options.h"

namespace {

constexpr double kShutdownSeconds = 5;

int Serve(const meshwright::CoordinatorSettings& settings) {
  const auto program = meshwright::CoordinatorProgram::Start(settings);
  if (!program.ok()) return meshwright::Fail(program.status());
  std::printf("listening on port %d\n", (*program)->port());
  if (const int port = (*program)->rest_port(); port > 0) std::printf("HTTP on port %d\n", port);
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
  BlockStopSignals();
  CLI::App program("Meshwright's coordinator: decides which camera is processed next, accepts surfaces, makes meshes.",
                   "meshwright-coordinator");
  program.set_version_flag("--version", absl::StrCat("meshwright-coordinator ", MW_VERSION));
  CoordinatorSettings settings;
  settings.threads = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  AddCoordinatorOptions(program, settings);
  AddConfigOption(program);
  try {
    ParseWithEnvironment(program, argc, argv);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return program.exit(error);
    return FailWrongUse(absl::StrCat(error.what(), " (--help shows what is expected)"));
  }
  if (settings.data_folder.empty()) return FailWrongUse("--data is required (--help shows what is expected)");
  return Serve(settings);
}
