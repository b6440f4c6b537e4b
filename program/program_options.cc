// SPDX-License-Identifier: Apache-2.0
#include "program/program_options.h"

#include <csignal>
#include <string>

#include <malloc.h>
#include <pthread.h>
#include <sys/stat.h>

#include "program/environment.h"

namespace meshwright {
namespace {

sigset_t StopSignals() {
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGINT);
  sigaddset(&signals, SIGTERM);
  return signals;
}

}  // namespace

void NameInEnvironment(CLI::Option* option) { option->envname(EnvironmentNameOf(option->get_single_name())); }

void AddMetricsOption(CLI::App& program, std::string& address) {
  NameInEnvironment(program.add_option("--metrics-listen", address,
                                       "host:port for Prometheus (/metrics) and probes (/healthz, /readyz) [none]"));
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
