#include "common/program/program_options.h"

#include <algorithm>
#include <csignal>
#include <cstdlib>
#include <string>
#include <vector>

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <malloc.h>
#include <pthread.h>
#include <sys/stat.h>

namespace meshwright {
namespace {

constexpr char kPrefix[] = "MESHWRIGHT_";

sigset_t StopSignals() {
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGINT);
  sigaddset(&signals, SIGTERM);
  return signals;
}

}  // namespace

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

void IgnoreFileSizeSignal() { std::signal(SIGXFSZ, SIG_IGN); }

void KeepFilesPrivate() { ::umask(S_IRWXG | S_IRWXO); }

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
