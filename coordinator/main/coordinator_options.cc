// SPDX-License-Identifier: Apache-2.0
#include "coordinator/main/coordinator_options.h"

#include "program/program_options.h"

namespace meshwright {

void AddRestOptions(CLI::App& program, CoordinatorSettings& settings) {
  NameInEnvironment(
      program
          .add_option("--rest-listen", settings.rest_listen,
                      "host:port for the REST interface and the dashboard; port 0 takes a free one [none]")
          ->capture_default_str());
  NameInEnvironment(program.add_option("--rest-tls-cert", settings.rest_tls_certificate_file,
                                       "file with the certificate for the REST interface and those above it, PEM; read "
                                       "again when it changes [no TLS]"));
  NameInEnvironment(program.add_option("--rest-tls-key", settings.rest_tls_key_file, "file with its key, PEM"));
  NameInEnvironment(program
                        .add_option("--trusted-proxy", settings.trusted_proxies,
                                    "addresses of proxies in front, with \",\" between them: callers are told apart by "
                                    "what these say in X-Forwarded-For")
                        ->delimiter(','));
  NameInEnvironment(
      program
          .add_option("--nodeodm-listen", settings.nodeodm_listen,
                      "host:port for NodeODM's protocol, which WebODM, PyODM, CloudODM and ClusterODM speak; "
                      "their port is 3000; port 0 takes a free one [none]")
          ->capture_default_str());
  NameInEnvironment(program
                        .add_option("--nodeodm-max-images", settings.nodeodm_max_images,
                                    "files that a task of NodeODM's protocol may have; 0: any number")
                        ->check(CLI::Range(0, 10'000'000))
                        ->capture_default_str());
  NameInEnvironment(program.add_option("--webhook-url", settings.webhook_url,
                                       "address of http or https that is told when a reconstruction is over [none]"));
  NameInEnvironment(program.add_option("--webhook-secret-file", settings.webhook_secret_file,
                                       "file with the secret that what is told is signed with"));
  NameInEnvironment(program.add_option("--dashboard", settings.page_folder,
                                       "folder with the dashboard's files [where they are installed]"));
  AddAccessOptions(program, settings);
}

void AddAccessOptions(CLI::App& program, CoordinatorSettings& settings) {
  NameInEnvironment(
      program.add_option("--api-token-file", settings.api_token_file,
                         "file with the operator's key: whoever calls, over HTTP or gRPC, then has to show "
                         "this one or one made with it (meshwright token) [nobody has to show a key]"));
  NameInEnvironment(program.add_option("--worker-token-file", settings.worker_token_file,
                                       "file with the key that workers join with [each has one made for it]"));
  NameInEnvironment(program.add_flag("--insecure", settings.insecure,
                                     "listen also where other machines reach it although nobody has to show a key"));
  NameInEnvironment(program.add_option("--tls-cert", settings.tls_certificate_file,
                                       "file with the certificate for gRPC and those above it, PEM; read again when it "
                                       "changes [no TLS]"));
  NameInEnvironment(program.add_option("--tls-key", settings.tls_key_file, "file with its key, PEM"));
  NameInEnvironment(program.add_option("--client-ca-file", settings.client_ca_file,
                                       "file with the certificates of those who may vouch for workers, PEM; read again "
                                       "when it changes: a worker may then show a certificate in place of a key [keys "
                                       "alone count]"));
  NameInEnvironment(program.add_flag("--grpc-reflection", settings.grpc_reflection,
                                     "tell everybody over gRPC which calls there are"));
  NameInEnvironment(
      program.add_option("--user-reconstructions", settings.user_reconstructions, "that one user may have at a time")
          ->check(CLI::Range(int64_t{1}, int64_t{1'000'000}))
          ->capture_default_str());
  NameInEnvironment(program.add_option("--user-gigabytes", settings.user_gigabytes, "that one user may have uploaded")
                        ->check(CLI::Range(int64_t{1}, int64_t{1'000'000}))
                        ->capture_default_str());
  NameInEnvironment(program
                        .add_option("--user-requests-per-second", settings.user_requests_per_second,
                                    "of one user, on average; who shows no valid key gets a tenth of it")
                        ->check(CLI::Range(1.0, 1e6))
                        ->capture_default_str());
}

void AddCoordinatorOptions(CLI::App& program, CoordinatorSettings& settings) {
  NameInEnvironment(
      program.add_option("--listen", settings.listen, "host:port for workers and clients; port 0 takes a free one")
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

}  // namespace meshwright
