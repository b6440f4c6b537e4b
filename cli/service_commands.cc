// SPDX-License-Identifier: Apache-2.0
#include <memory>
#include <string>
#include <utility>

#include <absl/strings/ascii.h>
#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/time/time.h>

#include "cli/commands.h"
#include "cli/mesh_output.h"
#include "cli/service_arguments.h"
#include "common/base/clock.h"
#include "common/base/files.h"
#include "common/mesh/formats/mesh_format.h"

namespace meshwright {
namespace {

using Json = nlohmann::ordered_json;

// How long whoever waits for a reconstruction waits for a coordinator that does not answer any more.
constexpr absl::Duration kCoordinatorMayBeAway = absl::Minutes(15);
constexpr absl::Duration kAskAgain = absl::Seconds(1);
constexpr char kStatePrefix[] = "RECONSTRUCTION_STATE_";

struct Arguments {
  ServiceArguments service;
  std::string id;
  std::string output_path;
  bool partial = false;
};

// ", about 3:20 left"; "" while nothing can be said.
std::string TimeLeft(const v1::Reconstruction& reconstruction) {
  if (!reconstruction.has_expected_finish_time()) return "";
  const double seconds = absl::ToDoubleSeconds(absl::FromUnixSeconds(reconstruction.expected_finish_time().seconds()) -
                                               SystemClock().Now());
  return seconds < 1 ? "" : absl::StrCat(", about ", FormatDuration(seconds), " left");
}

void PrintReconstruction(const v1::Reconstruction& reconstruction) {
  const v1::Progress& progress = reconstruction.progress();
  std::printf("%-32s %-10s", reconstruction.id().c_str(), NameOf(reconstruction.state()).c_str());
  if (reconstruction.state() == v1::RECONSTRUCTION_STATE_DONE) {
    std::printf(" %s vertices, %s faces", FormatCount(progress.vertices()).c_str(),
                FormatCount(progress.faces()).c_str());
  } else if (!reconstruction.stage().empty()) {
    std::printf(" %s", reconstruction.stage().c_str());
  } else if (progress.cameras_total() > 0) {
    std::printf(" cameras %d/%d, %d with workers", progress.cameras_committed(), progress.cameras_total(),
                progress.jobs_leased());
  }
  std::printf("%s", TimeLeft(reconstruction).c_str());
  if (progress.cameras_skipped() > 0) std::printf(", %d skipped", progress.cameras_skipped());
  std::printf("%s%s\n", reconstruction.failure().empty() ? "" : " ", reconstruction.failure().c_str());
  for (const std::string& warning : reconstruction.warnings()) std::printf("  %s\n", warning.c_str());
  const v1::Verdict& verdict = reconstruction.verdict();
  for (const std::string& text : {verdict.summary(), verdict.warning()}) {
    if (!text.empty()) std::printf("  %s\n", text.c_str());
  }
}

int Show(const absl::StatusOr<v1::Reconstruction>& reconstruction, const ServiceArguments& service) {
  if (!reconstruction.ok()) return FailCall(reconstruction.status(), service);
  if (service.output.json) {
    PrintJson(ToJson(*reconstruction));
  } else {
    PrintReconstruction(*reconstruction);
  }
  return kExitDone;
}

int ShowAll(const ServiceArguments& service) {
  const auto client = service.Connect();
  Json all = Json::array();
  int all_count = 0;
  std::string page_token;
  do {
    const absl::StatusOr<v1::ListReconstructionsResponse> page = client->List(page_token);
    if (!page.ok()) return FailCall(page.status(), service);
    for (const v1::Reconstruction& reconstruction : page->reconstructions()) {
      ++all_count;
      if (service.output.json) {
        all.push_back(ToJson(reconstruction));
      } else {
        PrintReconstruction(reconstruction);
      }
    }
    page_token = page->next_page_token();
  } while (!page_token.empty());
  if (service.output.json) {
    PrintJson({{"reconstructions", std::move(all)}});
  } else if (all_count == 0) {
    std::fprintf(stderr, "no reconstructions; submit one with: meshwright submit SCENE\n");
  }
  return kExitDone;
}

int ShowWorkers(const Arguments& arguments) {
  const absl::StatusOr<v1::ListWorkersResponse> response = arguments.service.Connect()->ListWorkers();
  if (!response.ok()) return FailCall(response.status(), arguments.service);
  Json all = Json::array();
  for (const v1::Worker& worker : response->workers()) {
    const double silent =
        absl::ToDoubleSeconds(SystemClock().Now() - absl::FromUnixSeconds(worker.last_seen().seconds()));
    all.push_back({{"id", worker.id()},
                   {"cores", worker.cores()},
                   {"memory_bytes", worker.memory_bytes()},
                   {"jobs", worker.jobs()},
                   {"draining", worker.draining()},
                   {"version", worker.version()}});
    if (arguments.service.output.json) continue;
    std::printf("%-32s %d jobs on %d cores, %s, heard of %s ago%s\n", worker.id().c_str(), worker.jobs(),
                worker.cores(), FormatBytes(static_cast<double>(worker.memory_bytes())).c_str(),
                FormatDuration(silent).c_str(), worker.draining() ? ", draining" : "");
  }
  if (arguments.service.output.json) PrintJson({{"workers", std::move(all)}});
  return kExitDone;
}

int Fetch(const Arguments& arguments) {
  if (const auto format = MeshFormatOfPath(arguments.output_path); !format.ok()) {
    return FailWrongUse(std::string(format.status().message()));
  }
  const auto client = arguments.service.Connect();
  const absl::Status status = FetchMesh(*client, arguments.id, arguments.output_path, arguments.partial);
  if (!status.ok()) return FailCall(status, arguments.service);
  if (arguments.service.output.json) {
    PrintJson({{"id", arguments.id}, {"mesh", arguments.output_path}});
  } else {
    std::printf("mesh     %s\n", arguments.output_path.c_str());
  }
  return kExitDone;
}

int Delete(const Arguments& arguments) {
  const absl::Status status = arguments.service.Connect()->Delete(arguments.id);
  return status.ok() ? kExitDone : FailCall(status, arguments.service);
}

// `unreadable` where the file cannot be read, "" where none is named.
std::string ReadOrWarn(const std::string& path, const std::string& unreadable) {
  if (path.empty()) return "";
  const absl::StatusOr<std::string> text = ReadFile(path);
  if (!text.ok()) Warn(std::string(text.status().message()));
  return text.ok() ? std::string(absl::StripAsciiWhitespace(*text)) : unreadable;
}

// Nobody listens there, as gRPC says it; a coordinator that answers has other words.
bool IsNobodyThere(const absl::Status& status) {
  const std::string message(status.message());
  return absl::IsUnavailable(status) &&
         (absl::StrContains(message, "failed to connect") || absl::StrContains(message, "DNS resolution failed") ||
          absl::StrContains(message, "connections to all backends failing"));
}

}  // namespace

std::unique_ptr<ServiceClient> ServiceArguments::Connect() const {
  // Never without TLS where TLS was asked for: nobody is vouched for by what is no certificate.
  return ServiceClient::Connect(
      coordinator, {.key = ReadOrWarn(token_file, ""), .ca_certificates = ReadOrWarn(ca_file, "no certificate")});
}

int FailCall(const absl::Status& status, const ServiceArguments& arguments) {
  if (!IsNobodyThere(status)) return Fail(status);
  return Fail(absl::UnavailableError(
      absl::StrCat("no coordinator answers at ", arguments.coordinator,
                   "; \"meshwright up\" starts one here, --coordinator HOST:PORT names another")));
}

void AddServiceOptions(CLI::App& command, ServiceArguments& arguments) {
  command.add_option("--coordinator", arguments.coordinator, "its host:port")
      ->envname("MESHWRIGHT_COORDINATOR")
      ->capture_default_str();
  command.add_option("--token-file", arguments.token_file, "file with the key to show [none is shown]")
      ->envname("MESHWRIGHT_TOKEN_FILE");
  command
      .add_option("--ca-file", arguments.ca_file,
                  "file with the certificates of those who may vouch for the coordinator, PEM; turns TLS on [no TLS]")
      ->envname("MESHWRIGHT_CA_FILE");
  AddOutputOptions(command, arguments.output);
}

std::string NameOf(v1::ReconstructionState state) {
  const std::string name = v1::ReconstructionState_Name(state);
  return absl::AsciiStrToLower(name.substr(sizeof(kStatePrefix) - 1));
}

// As report.json of a reconstruction in one process has it.
Json VerdictJson(const v1::Verdict& verdict) {
  Json json = {{"coverage", verdict.coverage()},
               {"inferred", verdict.inferred()},
               {"blind", verdict.blind()},
               {"inconsistent", verdict.inconsistent()},
               {"unsupported", verdict.unsupported()},
               {"contradicted", verdict.contradicted()},
               {"least_covered", nullptr},
               {"cameras_off_px", nullptr}};
  if (verdict.has_least_covered()) {
    json["least_covered"] = {{"name", verdict.least_covered().name()},
                             {"coverage", verdict.least_covered().coverage()}};
  }
  if (verdict.has_cameras_off_px()) json["cameras_off_px"] = verdict.cameras_off_px();
  if (!verdict.warning().empty()) json["warning"] = verdict.warning();
  return json;
}

Json ToJson(const v1::Reconstruction& reconstruction) {
  const v1::Progress& progress = reconstruction.progress();
  Json json;
  json["id"] = reconstruction.id();
  json["state"] = NameOf(reconstruction.state());
  if (!reconstruction.failure().empty()) json["failure"] = reconstruction.failure();
  if (!reconstruction.stage().empty()) json["stage"] = reconstruction.stage();
  if (reconstruction.warnings_size() > 0) {
    json["warnings"] = std::vector<std::string>(reconstruction.warnings().begin(), reconstruction.warnings().end());
  }
  json["cameras"] = {{"total", progress.cameras_total()},
                     {"committed", progress.cameras_committed()},
                     {"skipped", progress.cameras_skipped()},
                     {"with_workers", progress.jobs_leased()}};
  if (reconstruction.has_expected_finish_time()) {
    json["expected_finish"] = absl::FormatTime(
        absl::RFC3339_sec, absl::FromUnixSeconds(reconstruction.expected_finish_time().seconds()), absl::UTCTimeZone());
  }
  if (reconstruction.state() == v1::RECONSTRUCTION_STATE_DONE) {
    json["mesh"] = {{"vertices", progress.vertices()},
                    {"faces", progress.faces()},
                    {"bytes", reconstruction.mesh_bytes()},
                    {"sha256", reconstruction.mesh_sha256()}};
  }
  if (reconstruction.has_verdict()) json["verdict"] = VerdictJson(reconstruction.verdict());
  return json;
}

int WatchUntilOver(const ServiceArguments& arguments, ServiceClient& client, const std::string& id) {
  v1::Reconstruction last;
  Stopwatch since_answer;
  const auto tell = [&](const v1::Reconstruction& now) {
    const bool news = now.state() != last.state() ||
                      now.progress().cameras_committed() != last.progress().cameras_committed() ||
                      now.stage() != last.stage();
    last = now;
    since_answer = Stopwatch();
    if (arguments.output.quiet || !news) return;
    if (!now.stage().empty()) {
      std::fprintf(stderr, "%s: %s%s\n", id.c_str(), now.stage().c_str(), TimeLeft(now).c_str());
      return;
    }
    std::fprintf(stderr, "%s: %s, cameras %d/%d%s\n", id.c_str(), NameOf(now.state()).c_str(),
                 now.progress().cameras_committed(), now.progress().cameras_total(), TimeLeft(now).c_str());
  };
  absl::Status status = client.Watch(id, tell);
  // It has answered before: it is being restarted, or the network is away for a while.
  const bool has_answered = !last.id().empty() || !IsNobodyThere(status);
  bool told = false;
  while (has_answered && absl::IsUnavailable(status) && since_answer.Elapsed() < kCoordinatorMayBeAway) {
    if (!told && !arguments.output.quiet) {
      std::fprintf(stderr, "%s: the coordinator does not answer; waiting for it\n", id.c_str());
    }
    told = true;
    absl::SleepFor(kAskAgain);
    status = client.Watch(id, tell);
  }
  if (!status.ok()) return FailCall(status, arguments);
  const int shown = Show(last, arguments);
  return last.state() == v1::RECONSTRUCTION_STATE_DONE ? shown : kExitFailed;
}

void AddServiceCommands(CLI::App& program, Run& run) {
  const auto add = [&](const char* name, const char* description, const char* examples, auto&& what) {
    auto arguments = std::make_shared<Arguments>();
    CLI::App& command = *program.add_subcommand(name, description);
    command.footer(absl::StrCat("Examples:\n  ", examples));
    AddServiceOptions(command, arguments->service);
    command.callback([arguments, what, &run] { run = [arguments, what] { return what(*arguments); }; });
    return std::pair<CLI::App*, std::shared_ptr<Arguments>>(&command, arguments);
  };
  const auto add_with_id = [&](const char* name, const char* description, const char* examples, auto&& what) {
    const auto added = add(name, description, examples, what);
    added.first->add_option("ID", added.second->id, "the reconstruction")->required();
    return added;
  };
  const auto status = add("status", "Show a submitted reconstruction, or all of them", "meshwright status my-scene",
                          [](const Arguments& arguments) {
                            if (arguments.id.empty()) return ShowAll(arguments.service);
                            return Show(arguments.service.Connect()->Get(arguments.id), arguments.service);
                          });
  status.first->add_option("ID", status.second->id, "the reconstruction [all]");
  add_with_id("watch", "Follow a submitted reconstruction until it is over", "meshwright watch my-scene",
              [](const Arguments& arguments) {
                return WatchUntilOver(arguments.service, *arguments.service.Connect(), arguments.id);
              });
  const auto fetch = add_with_id("fetch", "Download the mesh of a submitted reconstruction",
                                 "meshwright fetch my-scene -o mesh.ply", Fetch);
  fetch.first
      ->add_option("-o,--output", fetch.second->output_path,
                   absl::StrCat("the mesh to write; its ending says the format: ", MeshFormatEndings()))
      ->required();
  fetch.first->add_flag("--partial", fetch.second->partial,
                        "while it is not done: the surfaces accepted so far, side by side");
  add_with_id("cancel", "Stop a submitted reconstruction", "meshwright cancel my-scene",
              [](const Arguments& arguments) {
                return Show(arguments.service.Connect()->Cancel(arguments.id), arguments.service);
              });
  add_with_id("delete", "Stop a submitted reconstruction and remove its mesh", "meshwright delete my-scene", Delete);
  add("workers", "Show the workers that the coordinator knows", "meshwright workers", ShowWorkers);
}

}  // namespace meshwright
