#include "cli/commands.h"

#include <algorithm>
#include <thread>
#include <vector>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>

#include "common/base/bad_input.h"
#include "common/scene/formats/formats.h"
#include "common/scene/formats/import.h"

namespace meshwright {

void AddFormatOption(CLI::App& command, SceneArguments& scene) {
  std::vector<std::string> names;
  for (const SceneFormat& format : SceneFormats()) names.emplace_back(format.name);
  command
      .add_option("--format", scene.format,
                  absl::StrCat("read the scene as ", absl::StrJoin(names, ", "), "; without it the content tells"))
      ->check(CLI::IsMember(names))
      ->type_name("FORMAT");
}

void AddOutputOptions(CLI::App& command, OutputSettings& output) {
  command.add_flag("--json", output.json, "print the result as JSON on stdout");
  command.add_flag("-q,--quiet", output.quiet, "no progress");
}

void AddThreadsOption(CLI::App& command, int& threads) {
  command.add_option("--threads", threads, "cores to use; no influence on the result")
      ->check(CLI::Range(1, 1024))
      ->capture_default_str();
}

int AvailableCores() { return std::max(1, static_cast<int>(std::thread::hardware_concurrency())); }

absl::StatusOr<Scene> LoadScene(const SceneArguments& arguments) {
  absl::StatusOr<Scene> scene = ImportScene(arguments.path, arguments.format);
  if (!scene.ok()) return BadInput(scene.status());
  return scene;
}

}  // namespace meshwright
