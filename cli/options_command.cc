#include <cstdio>
#include <memory>
#include <string>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_replace.h>

#include "pipeline/options/reconstruction_options.h"

#include "cli/commands.h"

namespace meshwright {
namespace {

std::string AsJson() {
  nlohmann::ordered_json options = nlohmann::ordered_json::array();
  for (const OptionDescription& option : DescribeOptions()) {
    options.push_back({{"group", option.group},
                       {"name", option.name},
                       {"type", option.default_value.is_number_integer() ? "integer" : "number"},
                       {"default", option.default_value},
                       {"help", option.help}});
  }
  return options.dump(2) + "\n";
}

std::string AsMarkdown() {
  std::string page =
      "# Options of a reconstruction\n"
      "Everything beside the photographs and cameras that the mesh depends on. Sections in parentheses are those of "
      "Jancosek,\n"
      "Shekhovtsov, Pajdla 2009. `meshwright reconstruct` and `meshwright submit` take them as flags (`--lattice-step "
      "1`), the\n"
      "REST and gRPC interfaces as members of `options` (`{\"lattice-step\": 1}`).\n\n"
      "This page is what `meshwright options --markdown` prints.\n";
  std::string group;
  for (const OptionDescription& option : DescribeOptions()) {
    if (option.group != group) {
      group = option.group;
      absl::StrAppend(&page, "\n## ", group, "\n| option | default | meaning |\n|---|---|---|\n");
    }
    absl::StrAppend(&page, "| `--", option.name, "` | ", option.default_value.dump(), " | ",
                    absl::StrReplaceAll(option.help, {{"|", "\\|"}}), " |\n");
  }
  return page;
}

std::string AsText() {
  std::string text;
  std::string group;
  for (const OptionDescription& option : DescribeOptions()) {
    if (option.group != group) {
      group = option.group;
      absl::StrAppend(&text, text.empty() ? "" : "\n", group, "\n");
    }
    absl::StrAppend(&text, "  --", option.name, " (", option.default_value.dump(), "): ", option.help, "\n");
  }
  return text;
}

}  // namespace

void AddOptionsCommand(CLI::App& program, Run& run) {
  struct Arguments {
    bool json = false;
    bool markdown = false;
  };
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = program.add_subcommand("options", "List what a mesh depends on beside its photographs");
  CLI::Option* json = command->add_flag("--json", arguments->json, "as a JSON array");
  command->add_flag("--markdown", arguments->markdown, "as a page (docs/options.md)")->excludes(json);
  command->callback([arguments, &run] {
    run = [arguments] {
      const std::string text = arguments->json ? AsJson() : arguments->markdown ? AsMarkdown() : AsText();
      std::fputs(text.c_str(), stdout);
      return kExitDone;
    };
  });
}

}  // namespace meshwright
