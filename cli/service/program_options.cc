#include "cli/service/program_options.h"

#include <algorithm>
#include <csignal>
#include <cstdlib>
#include <string>
#include <vector>

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <malloc.h>
#include <pthread.h>

namespace meshwright {
namespace {

constexpr char kPrefix[] = "MESHWRIGHT_";

// --scene-root -> MESHWRIGHT_SCENE_ROOT
void NameInEnvironment(CLI::Option* option) {
  std::string name = kPrefix;
  for (const char c : option->get_single_name()) {
    const bool lower = c >= 'a' && c <= 'z';
    name.push_back(c == '-' ? '_' : lower ? static_cast<char>(c - 'a' + 'A') : c);
  }
  option->envname(name);
}

void AddMetricsOption(CLI::App& program, std::string& address) {
  NameInEnvironment(program.add_option("--metrics-listen", address,
                                       "host:port for Prometheus (/metrics) and probes (/healthz, /readyz) [none]"));
}

sigset_t StopSignals() {
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGINT);
  sigaddset(&signals, SIGTERM);
  return signals;
}

}  // namespace

void AddRestOptions(CLI::App& program, CoordinatorSettings& settings) {
  NameInEnvironment(
      program
          .add_option("--rest-listen", settings.rest_listen,
                      "host:port for the REST interface and the dashboard; port 0 takes a free one [none]")
          ->capture_default_str());
  NameInEnvironment(program.add_option("--dashboard", settings.page_folder,
                                       "folder with the dashboard's files [where they are installed]"));
  NameInEnvironment(program.add_option("--api-token-file", settings.api_token_file,
                                       "file with the token that callers over HTTP have to show [none is asked for]"));
}

void AddCoordinatorOptions(CLI::App& program, CoordinatorSettings& settings) {
  NameInEnvironment(program
                        .add_option("--listen", settings.listen,
                                    "host:port for workers and clients; port 0 takes a free one. There is no "
                                    "authentication yet: only listen where everybody is trusted")
                        ->capture_default_str());
  NameInEnvironment(program.add_option("--data", settings.data_folder, "folder for state, uploads and meshes"));
  NameInEnvironment(program.add_option(
      "--store", settings.store, "sqlite:PATH or postgresql://USER@HOST:PORT/DATABASE [sqlite in the data folder]"));
  NameInEnvironment(
      program.add_option("--blobs", settings.blobs,
                         "folder or s3://BUCKET/PREFIX for surfaces and photographs; S3 takes AWS_ACCESS_KEY_ID, "
                         "AWS_SECRET_ACCESS_KEY, AWS_REGION and AWS_ENDPOINT_URL [in the data "
                         "folder]"));
  NameInEnvironment(program
                        .add_option("--scene-root", settings.scene_roots,
                                    "folders that scenes may be taken from by reference, with \":\" between them")
                        ->delimiter(':'));
  NameInEnvironment(program.add_option("--coordinator-threads", settings.threads, "cores for acceptance and joining")
                        ->check(CLI::Range(1, 1024))
                        ->capture_default_str());
  NameInEnvironment(
      program.add_option("--lease-seconds", settings.lease_seconds, "a worker that is silent longer has lost its jobs")
          ->check(CLI::Range(0.1, 3600.0))
          ->capture_default_str());
  NameInEnvironment(program
                        .add_option("--job-time-limit-seconds", settings.job_time_limit_seconds,
                                    "a camera that takes longer counts as failed")
                        ->check(CLI::Range(1.0, 1e6))
                        ->capture_default_str());
  AddRestOptions(program, settings);
  AddMetricsOption(program, settings.metrics_listen);
}

void AddWorkerOptions(CLI::App& program, WorkerSettings& settings) {
  NameInEnvironment(program.add_option("--coordinator", settings.coordinator, "its host:port")->capture_default_str());
  NameInEnvironment(program.add_option("--worker-id", settings.id, "unique [host name and process]"));
  NameInEnvironment(program.add_option(
      "--blobs", settings.blobs,
      "the coordinator's folder of blobs where it is shared, or s3://BUCKET/PREFIX [through the coordinator]"));
  NameInEnvironment(program.add_option("--cores", settings.cores, "jobs at the same time, and cores for all of them")
                        ->check(CLI::Range(1, 1024))
                        ->capture_default_str());
  NameInEnvironment(
      program
          .add_option("--memory", settings.memory_mib, "MiB for all jobs together [512 for each core, at least 1024]")
          ->check(CLI::Range(int64_t{64}, int64_t{1} << 30)));
  NameInEnvironment(program
                        .add_option("--drain-seconds", settings.drain_seconds,
                                    "after SIGTERM, jobs may take so long before they are given back")
                        ->check(CLI::Range(0.0, 86400.0))
                        ->capture_default_str());
  AddMetricsOption(program, settings.metrics_listen);
}

void AddConfigOption(CLI::App& program) {
  program.set_config("--config", "", "file with lines \"name = value\", e.g. cores = 4");
  NameInEnvironment(program.get_config_ptr());
}

void ParseWithEnvironment(CLI::App& program, int argc, char** argv) {
  std::vector<std::string> arguments(argv + std::min(argc, 1), argv + argc);
  // CLI11 would let the file win over the environment: what the environment says becomes part of the command line.
  for (CLI::Option* const option : program.get_options()) {
    const std::string name = option->get_envname();
    const char* const value = name.empty() ? nullptr : std::getenv(name.c_str());
    if (value == nullptr) continue;
    const std::string flag = absl::StrCat("--", option->get_single_name());
    const bool given = std::any_of(arguments.begin(), arguments.end(), [&](const std::string& argument) {
      return argument == flag || absl::StartsWith(argument, flag + "=");
    });
    if (!given) arguments.push_back(absl::StrCat(flag, "=", value));
  }
  std::reverse(arguments.begin(), arguments.end());  // as CLI11 wants them
  program.parse(arguments);
}

void KeepMemoryLow() {
  mallopt(M_MMAP_THRESHOLD, 1 << 20);
  mallopt(M_TRIM_THRESHOLD, 8 << 20);
}

void BlockStopSignals() {
  const sigset_t signals = StopSignals();
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
}

int WaitForStopSignal() {
  const sigset_t signals = StopSignals();
  int signal = 0;
  sigwait(&signals, &signal);
  return signal;
}

}  // namespace meshwright
