// SPDX-License-Identifier: Apache-2.0
// The service without photographs: many reconstructions of a flat wall, many workers whose camera jobs only sleep, a
// coordinator as a process of its own, PostgreSQL or SQLite. Prints what it measured as JSON. See docs/benchmarks.md.

#include <algorithm>
#include <csignal>
#include <cstdio>
#include <fstream>
#include <map>
#include <memory>
#include <sstream>
#include <thread>

#include <CLI/CLI.hpp>
#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <absl/time/clock.h>
#include <nlohmann/json.hpp>
#include <unistd.h>

#include "clients/cpp/service_client.h"

#include "common/base/check.h"
#include "common/base/clock.h"
#include "common/blob/filesystem_blob_store.h"
#include "coordinator/store/postgres_testing.h"
#include "tests/end_to_end/background_program.h"
#include "tests/end_to_end/program.h"
#include "tests/scale/event_listeners.h"
#include "tests/scale/fake_worker.h"
#include "tests/scale/wall_world.h"
#include "worker/agent/grpc_coordinator.h"

namespace meshwright::scale {
namespace {

struct Settings {
  std::string coordinator_program;
  std::string store = "postgres";
  int cameras = 10000;
  int reconstructions = 1;
  int small_cameras = 100;  // of all reconstructions but the first
  int workers = 200;
  int job_ms = 300;
  int window = 400;
  int event_streams = 0;   // of the first reconstruction
  double crash_share = 0;  // of all cameras, after which the coordinator is killed and started anew; 0: it is not
};

// A number of /proc/PROCESS/status.
double StatusNumber(pid_t process, const std::string& name) {
  std::ifstream status(absl::StrCat("/proc/", process, "/status"));
  for (std::string line; std::getline(status, line);) {
    if (absl::StartsWith(line.c_str(), name.c_str())) return std::stod(line.substr(name.size()));
  }
  return 0;
}

// Of the process so far.
double CpuSeconds(pid_t process) {
  std::ifstream stat(absl::StrCat("/proc/", process, "/stat"));
  std::string text;
  std::getline(stat, text);
  // Behind the name, which may have blanks in it: user and system time are the 12th and 13th.
  std::istringstream fields(text.substr(text.rfind(')') + 1));
  std::string skipped;
  for (int i = 0; i < 11; ++i) fields >> skipped;
  double user = 0;
  double system = 0;
  fields >> user >> system;
  return (user + system) / static_cast<double>(::sysconf(_SC_CLK_TCK));
}

std::string NameOf(int reconstruction) { return absl::StrCat("wall-", reconstruction); }

double Percentile(std::vector<double>& values, double share) {
  if (values.empty()) return 0;
  const auto place = values.begin() + static_cast<int64_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), place, values.end());
  return *place;
}

std::vector<v1::Reconstruction> GetAll(ServiceClient& client, const Settings& settings) {
  std::vector<v1::Reconstruction> all;
  for (int i = 0; i < settings.reconstructions; ++i) {
    const auto one = client.Get(NameOf(i));
    // Only where the coordinator is being started anew nobody answers.
    MW_CHECK(one.ok() || settings.crash_share > 0);
    if (!one.ok()) return {};
    MW_CHECK(one->state() != v1::RECONSTRUCTION_STATE_FAILED);
    all.push_back(*one);
  }
  return all;
}

int64_t CommittedIn(const std::vector<v1::Reconstruction>& all) {
  int64_t committed = 0;
  for (const v1::Reconstruction& one : all) committed += one.progress().cameras_committed();
  return committed;
}

int Measure(const Settings& settings) {
  const TemporaryFolder folder;
  WallWorld(settings.cameras).Write(folder / "scenes/large");
  if (settings.reconstructions > 1) WallWorld(settings.small_cameras).Write(folder / "scenes/small");

  std::unique_ptr<PostgresServer> postgres;
  std::vector<std::string> arguments = {"--data",        folder / "data",   "--listen",        "127.0.0.1:0",
                                        "--scene-root",  folder / "scenes", "--lease-seconds", "30",
                                        "--rest-listen", "127.0.0.1:0"};
  if (settings.store == "postgres") {
    auto started = PostgresServer::Start(/*durable=*/true);
    MW_CHECK(started.ok());
    postgres = *std::move(started);
    arguments.insert(arguments.end(), {"--store", postgres->url()});
  }
  const std::string log = folder / "coordinator.log";
  auto coordinator = std::make_unique<end_to_end::BackgroundProgram>(settings.coordinator_program, arguments, log);
  const std::string address = absl::StrCat("127.0.0.1:", end_to_end::ListeningPort(log));

  const std::unique_ptr<ServiceClient> client = ServiceClient::Connect(address);
  const Stopwatch until_first_job;
  std::map<std::string, double> ended;  // seconds since the first job could run
  for (int i = 0; i < settings.reconstructions; ++i) {
    v1::CreateReconstructionRequest request;
    request.set_id(NameOf(i));
    request.set_scene_reference(i == 0 ? "file:large" : "file:small");
    request.set_options_json(absl::StrCat(R"({"refine-cameras": 0, "window": )", settings.window, "}"));
    MW_CHECK(client->Create(request).ok());
    const auto begun = client->Start(NameOf(i));
    MW_CHECK(begun.ok());
  }
  // The scenes become blobs and pairs before the first job is there.
  for (int i = 0; i < settings.reconstructions; ++i) {
    while (client->Get(NameOf(i))->progress().cameras_total() == 0) absl::SleepFor(absl::Milliseconds(50));
  }

  const double seconds_until_first_job = until_first_job.Seconds();
  const auto blobs = FilesystemBlobStore::Open(folder / "data/blobs");
  MW_CHECK(blobs.ok());
  std::vector<std::unique_ptr<GrpcCoordinator>> channels;
  std::vector<std::unique_ptr<FakeWorker>> workers;
  for (int i = 0; i < settings.workers; ++i) {
    channels.push_back(GrpcCoordinator::Connect(address));
    workers.push_back(std::make_unique<FakeWorker>(absl::StrCat("worker-", i), *channels.back(), **blobs,
                                                   absl::Milliseconds(settings.job_ms)));
  }
  EventListeners listeners(end_to_end::ListeningPort(log, "HTTP on port "), NameOf(0), settings.event_streams);
  std::vector<FakeWorkerFigures> figures(workers.size());
  std::vector<std::thread> threads;
  const Stopwatch stopwatch;
  for (size_t i = 0; i < workers.size(); ++i) {
    threads.emplace_back([&, i] { figures[i] = workers[i]->Run(); });
  }

  // Until every camera is committed; joining the meshes is not measured.
  int64_t committed = 0;
  int64_t total = 0;
  for (const v1::Reconstruction& one : GetAll(*client, settings)) total += one.progress().cameras_total();
  Stopwatch since_crash;
  int64_t committed_at_crash = -1;
  double seconds_until_committed_again = 0;
  while (static_cast<int>(ended.size()) < settings.reconstructions) {
    absl::SleepFor(absl::Milliseconds(100));
    const std::vector<v1::Reconstruction> all = GetAll(*client, settings);
    if (all.empty()) continue;
    committed = CommittedIn(all);
    for (const v1::Reconstruction& one : all) {
      const v1::Progress& progress = one.progress();
      if (progress.cameras_committed() + progress.cameras_skipped() >= progress.cameras_total()) {
        ended.try_emplace(one.id(), stopwatch.Seconds());
      }
    }
    if (settings.crash_share > 0 && committed_at_crash < 0 &&
        static_cast<double>(committed) >= settings.crash_share * static_cast<double>(total)) {
      coordinator->Stop(SIGKILL);
      committed_at_crash = committed;
      since_crash = Stopwatch();
      *std::find(arguments.begin(), arguments.end(), "127.0.0.1:0") = address;  // the first: of gRPC
      coordinator =
          std::make_unique<end_to_end::BackgroundProgram>(settings.coordinator_program, arguments, log + ".again");
    } else if (committed_at_crash >= 0 && seconds_until_committed_again == 0 && committed > committed_at_crash) {
      seconds_until_committed_again = since_crash.Seconds();
    }
  }
  const double elapsed = stopwatch.Seconds();
  for (const auto& worker : workers) worker->Stop();
  for (std::thread& thread : threads) thread.join();

  std::vector<double> answers;
  double busy = 0;
  int64_t failed_calls = 0;
  for (FakeWorkerFigures& one : figures) {
    answers.insert(answers.end(), one.answer_seconds.begin(), one.answer_seconds.end());
    busy += one.busy_seconds;
    failed_calls += one.failed_calls;
  }
  nlohmann::ordered_json json;
  json["cameras_committed"] = committed;
  json["seconds_until_first_job"] = seconds_until_first_job;
  json["seconds"] = elapsed;
  json["camera_jobs_per_second"] = static_cast<double>(committed) / elapsed;
  json["synchronize_ms"] = {{"median", 1e3 * Percentile(answers, 0.5)},
                            {"p99", 1e3 * Percentile(answers, 0.99)},
                            {"max", 1e3 * Percentile(answers, 1)}};
  json["failed_calls"] = failed_calls;
  if (settings.crash_share > 0) json["seconds_until_committed_again"] = seconds_until_committed_again;
  json["idle_share"] = 1 - busy / (elapsed * settings.workers);
  json["coordinator_cpu_s"] = CpuSeconds(coordinator->id());
  if (settings.event_streams > 0) {
    json["event_streams"] = {{"clients", settings.event_streams},
                             {"dropped", listeners.dropped()},
                             {"parts_read_per_client", static_cast<double>(listeners.parts()) / settings.event_streams},
                             {"bytes_read", listeners.bytes()}};
  }
  json["coordinator_threads"] = StatusNumber(coordinator->id(), "Threads:");
  json["coordinator_peak_mib"] = StatusNumber(coordinator->id(), "VmHWM:") / 1024;
  std::vector<double> small;
  for (const auto& [name, seconds] : ended) {
    if (name != NameOf(0)) small.push_back(seconds);
  }
  if (!small.empty()) {
    json["large_ended_after_s"] = ended[NameOf(0)];
    json["small_ended_after_s"] = {
        {"first", Percentile(small, 0)}, {"median", Percentile(small, 0.5)}, {"last", Percentile(small, 1)}};
  }
  std::printf("%s\n", json.dump(2).c_str());
  return 0;
}

}  // namespace
}  // namespace meshwright::scale

int main(int argc, char** argv) {
  meshwright::scale::Settings settings;
  CLI::App program("Measures the service without photographs");
  program.add_option("--coordinator-program", settings.coordinator_program)->required();
  program.add_option("--store", settings.store)->check(CLI::IsMember({"postgres", "sqlite"}))->capture_default_str();
  program.add_option("--cameras", settings.cameras)->capture_default_str();
  program.add_option("--reconstructions", settings.reconstructions)->capture_default_str();
  program.add_option("--small-cameras", settings.small_cameras, "of all reconstructions but the first")
      ->capture_default_str();
  program.add_option("--workers", settings.workers)->capture_default_str();
  program.add_option("--job-ms", settings.job_ms)->capture_default_str();
  program.add_option("--window", settings.window)->capture_default_str();
  program.add_option("--event-streams", settings.event_streams, "clients that follow the first reconstruction")
      ->capture_default_str();
  program
      .add_option("--crash-share", settings.crash_share,
                  "of all cameras, after which the coordinator is killed and started anew; 0: it is not")
      ->capture_default_str();
  CLI11_PARSE(program, argc, argv);
  return meshwright::scale::Measure(settings);
}
