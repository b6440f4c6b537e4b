// SPDX-License-Identifier: Apache-2.0
#include "worker/main/worker_options.h"

#include "program/program_options.h"

namespace meshwright {

void AddWorkerOptions(CLI::App& program, WorkerSettings& settings) {
  NameInEnvironment(program.add_option("--coordinator", settings.coordinator, "its host:port")->capture_default_str());
  NameInEnvironment(program.add_option("--worker-id", settings.id, "unique [host name and process]"));
  NameInEnvironment(program.add_option(
      "--blobs", settings.blobs,
      "the coordinator's folder of blobs where it is shared, or s3://BUCKET/PREFIX [through the coordinator]"));
  NameInEnvironment(
      program.add_option("--token-file", settings.token_file, "file with the key to join with [none is shown]"));
  NameInEnvironment(program.add_option(
      "--ca-file", settings.ca_file,
      "file with the certificates of those who may vouch for the coordinator, PEM; turns TLS on [no TLS]"));
  NameInEnvironment(program.add_option("--client-cert", settings.client_certificate_file,
                                       "file with the worker's certificate and those above it, PEM: it stands for a "
                                       "key; --worker-id is its name, or that, \"+\" and more [none is shown]"));
  NameInEnvironment(program.add_option("--client-key", settings.client_key_file, "file with its key, PEM"));
  NameInEnvironment(program.add_option("--cores", settings.cores, "jobs at the same time, and cores for all of them")
                        ->check(CLI::Range(1, 1024))
                        ->capture_default_str());
  NameInEnvironment(
      program
          .add_option("--memory", settings.memory_mib, "MiB for all jobs together [512 for each core, at least 1024]")
          ->check(CLI::Range(int64_t{64}, int64_t{1} << 30)));
  NameInEnvironment(program
                        .add_option("--drain-seconds", settings.drain_seconds,
                                    "after SIGTERM, jobs may take so long before they are released")
                        ->check(CLI::Range(0.0, 86400.0))
                        ->capture_default_str());
  NameInEnvironment(program
                        .add_option("--exit-when-idle", settings.exit_when_idle_seconds,
                                    "seconds without a job after which the worker ends [it waits for more]")
                        ->check(CLI::Range(1.0, 86400.0)));
  AddMetricsOption(program, settings.metrics_listen);
}

}  // namespace meshwright
