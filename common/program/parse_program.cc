#include "common/program/parse_program.h"

#include <absl/strings/str_cat.h>

#include "common/program/console.h"
#include "common/program/program_options.h"

namespace meshwright {

std::optional<int> ParseProgram(CLI::App& program, int argc, char** argv) {
  program.set_version_flag("--version", absl::StrCat(program.get_name(), " ", MW_VERSION));
  AddConfigOption(program);
  try {
    ParseWithEnvironment(program, argc, argv);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return program.exit(error);
    return FailWrongUse(absl::StrCat(error.what(), " (--help shows what is expected)"));
  }
  return std::nullopt;
}

}  // namespace meshwright
