// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cctype>
#include <filesystem>
#include <map>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include "pipeline/cameras/photograph_folder.h"
#include "pipeline/options/option_table.h"
#include "pipeline/options/options_json.h"

#include "cli/commands.h"
#include "cli/mesh_output.h"
#include "cli/reconstruction_flags.h"
#include "cli/service_arguments.h"
#include "common/base/bad_input.h"
#include "common/base/digest.h"
#include "common/base/files.h"
#include "common/base/status_macros.h"
#include "common/base/utf8.h"
#include "common/json/json_text.h"
#include "common/mesh/formats/mesh_format.h"

namespace meshwright {
namespace {

namespace fs = std::filesystem;

constexpr char kExamples[] = R"(Examples:
  meshwright submit photographs -o mesh.ply         # upload them, a worker with COLMAP estimates their cameras; wait
  meshwright submit my-scene -o mesh.ply            # upload it, wait, download the mesh
  meshwright submit my-scene --id first-try         # upload it; then: meshwright watch first-try
  meshwright submit file:campaign/7 --wait          # a folder below the coordinator's --scene-root)";

constexpr char kByReference[] = "file:";
constexpr char kRegionFile[] = "region.json";  // which a scene's region is taken from
constexpr char kNoRegion[] = "none";

struct Arguments {
  ServiceArguments service;
  SceneArguments scene;
  ReconstructionOptions options;
  std::string id;
  double weight = 1;
  bool wait = false;
  std::string output_path;
};

// fountain-P11 -> fountain-p11-3f9a01
std::string DrawId(const std::string& scene) {
  fs::path path = fs::path(scene).lexically_normal();
  if (!path.has_filename()) path = path.parent_path();
  std::string id;
  for (const char c : path.filename().string()) {
    const auto byte = static_cast<unsigned char>(c);
    const bool plain = byte < 128 && std::isalnum(byte) != 0;
    if (plain || !id.empty()) id.push_back(plain ? static_cast<char>(std::tolower(byte)) : '-');
  }
  std::random_device random;
  return absl::StrFormat("%s-%06x", id.empty() ? "scene" : id.substr(0, 50), random() & 0xFFFFFFU);
}

// Files below the scene's folder that a scene may consist of; meshes are not among them.
absl::StatusOr<std::vector<std::string>> FilesOf(const std::string& folder) {
  std::vector<std::string> files;
  std::error_code error;
  constexpr int kDeepest = 8;  // links may go in circles
  // images/ of a scene that COLMAP made is a link to the photographs.
  auto it = fs::recursive_directory_iterator(folder, fs::directory_options::follow_directory_symlink, error);
  for (; !error && it != fs::recursive_directory_iterator(); it.increment(error)) {
    if (it.depth() >= kDeepest) it.disable_recursion_pending();
    if (absl::StartsWith(it->path().filename().string(), ".")) {
      if (it->is_directory()) it.disable_recursion_pending();
    } else if (it->is_regular_file() && it->path().extension() != ".ply") {
      files.push_back(fs::path(it->path()).lexically_relative(folder).string());
    }
  }
  if (error) return absl::PermissionDeniedError(absl::StrCat(folder, ": cannot be read: ", error.message()));
  std::sort(files.begin(), files.end());
  for (const std::string& file : files) {
    if (IsUtf8(file)) continue;
    return BadInput(absl::InvalidArgumentError(
        absl::StrCat(folder, ": the name of ", ToUtf8(file),
                     " is not UTF-8, which uploads need; rename it, also where the scene names it")));
  }
  return files;
}

absl::StatusOr<std::string> DigestOfFile(const std::string& path) {
  MW_ASSIGN_OR_RETURN(const std::string bytes, ReadFile(path));
  return Sha256Hex(bytes);
}

// Where each file that is sent comes from: the scene's folder, or --region.
std::map<std::string, std::string> Sources(const Arguments& arguments, const std::vector<std::string>& files) {
  std::map<std::string, std::string> sources;
  for (const std::string& file : files) sources[file] = (fs::path(arguments.scene.path) / file).string();
  const std::string& region = arguments.scene.import.region;
  if (region == kNoRegion) sources.erase(kRegionFile);
  if (!region.empty() && region != kNoRegion) sources[kRegionFile] = region;
  return sources;
}

// Sends what is not there yet. An id that was used before stands for one scene: FailedPrecondition when this is
// another.
absl::Status Upload(const Arguments& arguments, const std::vector<std::string>& files, bool is_started,
                    ServiceClient& client) {
  const std::map<std::string, std::string> sources = Sources(arguments, files);
  MW_ASSIGN_OR_RETURN(const v1::ListSceneFilesResponse there, client.ListSceneFiles(arguments.id));
  std::map<std::string, std::string> digests;  // of what is there
  for (const v1::SceneFile& file : there.files()) digests[file.path()] = file.sha256();
  const auto another = [&](const std::string& file, const char* what) {
    return absl::FailedPreconditionError(
        absl::StrCat(arguments.id, " was submitted with another scene: ", file, " ", what, "; choose another --id"));
  };
  for (const auto& [file, digest] : digests) {
    if (sources.count(file) == 0) return another(file, "is not in this one");
  }
  int sent = 0;
  for (const auto& [file, path] : sources) {
    const auto found = digests.find(file);
    if (found == digests.end() && is_started) return another(file, "was not in it");
    if (found != digests.end()) {
      MW_ASSIGN_OR_RETURN(const std::string digest, DigestOfFile(path));
      if (digest != found->second) return another(file, "has other bytes");
      continue;
    }
    MW_RETURN_IF_ERROR(client.Upload(arguments.id, file, path));
    if (!arguments.service.output.quiet && ++sent % 50 == 0) {
      std::fprintf(stderr, "%s: %d/%d files uploaded\n", arguments.id.c_str(), sent, static_cast<int>(sources.size()));
    }
  }
  return absl::OkStatus();
}

// A scene, or photographs whose cameras a worker will estimate.
absl::Status CheckScene(const Arguments& arguments) {
  if (!LacksCameras(arguments.scene)) return LoadScene(arguments.scene).status();
  MW_ASSIGN_OR_RETURN(const PhotographFolder folder, ListPhotographs(arguments.scene.path));
  if (!arguments.service.output.quiet) {
    std::fprintf(stderr, "%d photographs without cameras: a worker with COLMAP will estimate them\n",
                 static_cast<int>(folder.photographs.size()));
  }
  return absl::OkStatus();
}

int Submit(Arguments& arguments) {
  if (const absl::Status valid = CheckOptions(arguments.options, "--"); !valid.ok()) {
    return FailWrongUse(std::string(valid.message()));
  }
  if (!arguments.output_path.empty()) {
    if (const auto format = MeshFormatOfPath(arguments.output_path); !format.ok()) {
      return FailWrongUse(std::string(format.status().message()));
    }
  }
  const bool by_reference = absl::StartsWith(arguments.scene.path, kByReference);
  if (arguments.id.empty()) arguments.id = DrawId(arguments.scene.path);
  std::vector<std::string> files;
  if (!by_reference) {
    // Better known here and now than after it was uploaded.
    if (const absl::Status usable = CheckScene(arguments); !usable.ok()) return Fail(usable);
    const absl::StatusOr<std::vector<std::string>> listed = FilesOf(arguments.scene.path);
    if (!listed.ok()) return Fail(listed.status());
    files = *listed;
  } else if (!IsUtf8(arguments.scene.path)) {
    return FailWrongUse(absl::StrCat(ToUtf8(arguments.scene.path), ": a name in UTF-8 expected"));
  }
  const auto client = arguments.service.Connect();
  v1::CreateReconstructionRequest request;
  request.set_id(arguments.id);
  request.set_options_json(JsonText(ToJson(arguments.options)));
  request.set_weight(arguments.weight);
  if (by_reference) request.set_scene_reference(arguments.scene.path);
  const absl::StatusOr<v1::Reconstruction> created = client->Create(request);
  if (!created.ok()) return FailCall(created.status(), arguments.service);
  if (!by_reference) {
    const bool is_started = created->state() != v1::RECONSTRUCTION_STATE_CREATED;
    const absl::Status uploaded = Upload(arguments, files, is_started, *client);
    if (!uploaded.ok()) return FailCall(uploaded, arguments.service);
  }
  const absl::StatusOr<v1::Reconstruction> started = client->Start(arguments.id);
  if (!started.ok()) return FailCall(started.status(), arguments.service);
  const bool wait = arguments.wait || !arguments.output_path.empty();
  if (!wait) {
    if (arguments.service.output.json) {
      PrintJson(ToJson(*started));
    } else {
      std::printf("%s\n", arguments.id.c_str());
    }
    return kExitDone;
  }
  const int ended = WatchUntilOver(arguments.service, *client, arguments.id);
  if (ended != kExitDone || arguments.output_path.empty()) return ended;
  const absl::Status fetched = FetchMesh(*client, arguments.id, arguments.output_path, /*partial=*/false);
  return fetched.ok() ? kExitDone : FailCall(fetched, arguments.service);
}

}  // namespace

void AddSubmitCommand(CLI::App& program, Run& run) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App& command = *program.add_subcommand("submit", "Have a scene reconstructed by a coordinator and its workers");
  command.footer(kExamples);
  command
      .add_option(
          "SCENE", arguments->scene.path,
          "folder with photographs and their cameras, to be uploaded; without cameras a worker with COLMAP estimates "
          "them; or file:FOLDER below the coordinator's roots")
      ->required();
  command.add_option(
      "--id", arguments->id,
      "name of the reconstruction, unique: a-z, 0-9 and \"-\"; submitting again under the same name goes "
      "on where it was [from the folder's name]");
  command.add_option("--weight", arguments->weight, "share of the workers against other reconstructions")
      ->check(CLI::Range(0.001, 1000.0))
      ->capture_default_str();
  command
      .add_option("--region", arguments->scene.import.region,
                  "a box (JSON) outside of which nothing is reconstructed, sent as the scene's region.json; \"none\"")
      ->check(CLI::ExistingFile | CLI::IsMember({kNoRegion}))
      ->type_name("FILE|none");
  command.add_flag("--wait", arguments->wait, "until it is over");
  command.add_option("-o,--output", arguments->output_path,
                     absl::StrCat("wait and write the mesh; its ending says the format: ", MeshFormatEndings()));
  AddServiceOptions(command, arguments->service);
  AddReconstructionFlags(command, arguments->options);
  command.callback([arguments, &run] { run = [arguments] { return Submit(*arguments); }; });
}

}  // namespace meshwright
