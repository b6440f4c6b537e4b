// SPDX-License-Identifier: Apache-2.0
#include <cstdio>
#include <memory>
#include <string>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_replace.h>

#include "pipeline/options/option_table.h"
#include "pipeline/options/presets.h"

#include "cli/commands.h"
#include "common/json/json_text.h"

namespace meshwright {
namespace {

nlohmann::ordered_json ToJson(OptionValue value) {
  return std::visit([](auto number) { return nlohmann::ordered_json(number); }, value);
}

std::string AsJson() {
  nlohmann::ordered_json options = nlohmann::ordered_json::array();
  for (const Option& option : OptionTable()) {
    options.push_back({{"group", option.section},
                       {"name", option.name},
                       {"type", option.is_integer() ? "integer" : "number"},
                       {"unit", option.unit},
                       {"default", ToJson(option.Default())},
                       {"minimum", option.minimum},
                       {"maximum", option.maximum},
                       {"help", option.help},
                       {"trade_off", option.trade_off}});
  }
  return JsonText(options, 2) + "\n";
}

std::string AsMarkdown() {
  std::string page =
      "# Options of a reconstruction\n"
      "Everything beside the photographs and cameras that the mesh depends on. Sections in parentheses are those of "
      "Jancosek,\n"
      "Shekhovtsov, Pajdla 2009. `meshwright reconstruct` and `meshwright submit` take them as flags (`--lattice-step "
      "1`), the\n"
      "REST and gRPC interfaces as members of `options_json` (`{\"lattice-step\": 1}`). Both ends of a range are "
      "allowed.\n\n"
      "This page is what `meshwright options --markdown` prints.\n\n"
      "## Presets\n"
      "`--preset NAME`, `{\"preset\": \"NAME\"}` in `options_json`: values that go together. Options that are given by "
      "themselves win.\n"
      "`meshwright inspect SCENE --preset NAME` says how long it will take.\n\n"
      "| preset | for | options |\n|---|---|---|\n";
  for (const Preset& preset : Presets()) {
    absl::StrAppend(&page, "| `", preset.name, "` | ", preset.help, " | ", DescribeValues(preset), " |\n");
  }
  std::string section;
  for (const Option& option : OptionTable()) {
    if (option.section != section) {
      section = option.section;
      absl::StrAppend(&page, "\n## ", section,
                      "\n| option | default | range | meaning | what it costs |\n|---|---|---|---|---|\n");
    }
    absl::StrAppend(&page, "| `--", option.name, "` | ", FormatValue(option.Default()), " | ", DescribeRange(option),
                    " | ", absl::StrReplaceAll(option.help, {{"|", "\\|"}}), " | ", option.trade_off, " |\n");
  }
  return page;
}

std::string AsText() {
  std::string text = "Presets\n";
  for (const Preset& preset : Presets()) {
    absl::StrAppend(&text, "  --", kPreset, " ", preset.name, ": ", preset.help, " (", DescribeValues(preset), ")\n");
  }
  std::string section;
  for (const Option& option : OptionTable()) {
    if (option.section != section) {
      section = option.section;
      absl::StrAppend(&text, "\n", section, "\n");
    }
    absl::StrAppend(&text, "  --", option.name, " (", FormatValue(option.Default()), "; ", DescribeRange(option),
                    "): ", option.help, "; ", option.trade_off, "\n");
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
