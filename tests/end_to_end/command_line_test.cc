// SPDX-License-Identifier: Apache-2.0
// What scripts and people rely on: help, exit codes, where things are printed.

#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "pipeline/options/option_table.h"
#include "pipeline/options/option_testing.h"

#include "tests/end_to_end/program.h"

namespace meshwright::end_to_end {
namespace {

TEST(CommandLineTest, EveryCommandHasHelpWithExamples) {
  for (const std::string command : {"reconstruct", "inspect", "evaluate", "synthesize", "render", "convert"}) {
    const RunResult result = RunMeshwright({command, "--help"});
    EXPECT_EQ(result.exit_code, 0);
    EXPECT_THAT(result.out, testing::HasSubstr("Examples:\n  meshwright " + command));
    EXPECT_THAT(RunMeshwright({"--help"}).out, testing::HasSubstr(command));
  }
}

TEST(CommandLineTest, ItTellsItsVersion) {
  const RunResult result = RunMeshwright({"--version"});
  EXPECT_EQ(result.exit_code, 0);
  EXPECT_THAT(result.out, testing::MatchesRegex("meshwright [0-9]+\\.[0-9]+\\.[0-9]+\n"));
}

TEST(CommandLineTest, WrongUseIsTwo) {
  const std::vector<std::vector<std::string>> wrong = {
      {},
      {"reconstrukt"},
      {"reconstruct"},
      {"reconstruct", "scene"},
      {"reconstruct", "scene", "-o", "x.ply", "--nonsense"},
      {"reconstruct", "scene", "-o", "x.docx"},
      {"reconstruct", "scene", "-o", "x"},
      {"convert", "x.ply", "-o", "x.docx"},
      {"convert", "x.ply", "-o", "x.las", "--compress"},
      {"fetch", "id", "-o", "x.docx"},
      {"reconstruct", "scene", "-o", "x.ply", "--threads", "0"},
      {"reconstruct", "scene", "-o", "x.ply", "--threads", "many"},
      {"reconstruct", "scene", "-o", "x.ply", "--window", "0"},
      {"reconstruct", "scene", "-o", "x.ply", "--max-targets", "17"},
      {"reconstruct", "scene", "-o", "x.ply", "--min-quality", "nan"},
      {"reconstruct", "scene", "-o", "x.ply", "--format", "jpeg"},
      {"synthesize", "castle", "-o", "x"},
      {"synthesize", "ring", "-o", "x", "--cameras", "1"},
      {"evaluate", "a.ply", "b.ply"},
  };
  for (const std::vector<std::string>& arguments : wrong) {
    const RunResult result = RunMeshwright(arguments);
    EXPECT_EQ(result.exit_code, 2) << testing::PrintToString(arguments) << result.err;
    EXPECT_THAT(result.err, testing::StartsWith("meshwright: "));
    EXPECT_EQ(result.out, "");
  }
}

TEST(CommandLineTest, AnUnknownCommandOrOptionIsNamedWithTheNearest) {
  EXPECT_THAT(RunMeshwright({"reconstrukt"}).err,
              testing::StartsWith("meshwright: there is no command reconstrukt, did you mean reconstruct?"));
  EXPECT_THAT(RunMeshwright({"reconstruct", "scene", "--ouput", "x.ply"}).err,
              testing::StartsWith("meshwright: there is no option --ouput, did you mean --output?"));
  EXPECT_THAT(RunMeshwright({"submit", "scene", "--suport", "2"}).err,
              testing::StartsWith("meshwright: there is no option --suport, did you mean --support?"));
}

TEST(CommandLineTest, InspectSaysWhatWillBeDone) {
  const RunResult result = RunMeshwright({"inspect", SharedScene("small"), "--json"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const nlohmann::json inspection = JsonOf(result);
  ASSERT_TRUE(inspection.is_object()) << result.out;
  EXPECT_EQ(inspection["photographs"], 8);
  EXPECT_EQ(inspection["format"], "colmap-text");
  EXPECT_GT(inspection["pairs"]["feasible"], 8);
  EXPECT_EQ(inspection["lattice"]["columns"]["largest"], 240);
  EXPECT_GT(inspection["expected"]["job_memory_bytes"], 1 << 20);
  EXPECT_THAT(RunMeshwright({"inspect", SharedScene("small")}).out, testing::HasSubstr("8 photographs"));
}

TEST(CommandLineTest, ThePageOfOptionsIsWhatTheProgramHas) {
  EXPECT_EQ(ReadBytes("docs/options.md"), RunMeshwright({"options", "--markdown"}).out)
      << "write it anew: meshwright options --markdown > docs/options.md";
  EXPECT_EQ(JsonOf(RunMeshwright({"options", "--json"})).size(), OptionTable().size());
}

TEST(CommandLineTest, HelpSaysWhatIsDeclared) {
  for (const char* command : {"reconstruct", "inspect", "submit"}) {
    const std::string help = RunMeshwright({command, "--help"}).out;
    for (const Option& option : OptionTable()) {
      EXPECT_THAT(help, testing::HasSubstr("--" + std::string(option.name) + " "));
      EXPECT_THAT(help, testing::HasSubstr(std::string(option.help) + " [" + DescribeRange(option) + "]"));
    }
  }
}

// A scene that is not there is looked for once the options are good: exit code 3 says that they are.
TEST(CommandLineTest, EveryOptionIsAcceptedAtItsBoundsAndRefusedBeyond) {
  for (const Option& option : OptionTable()) {
    for (const double bound : {option.minimum, option.maximum}) {
      std::vector<std::string> arguments = {"inspect", "/nowhere/scene"};
      for (const auto& [set, value] : ValuesWith(option, bound)) {
        arguments.push_back("--" + std::string(set->name) + "=" + FormatValue(value));
      }
      const RunResult result = RunMeshwright(arguments);
      EXPECT_EQ(result.exit_code, 3) << testing::PrintToString(arguments) << result.err;
    }
    for (const std::string& text : RefusedTexts(option)) {
      const std::string flag = "--" + std::string(option.name);
      const RunResult result = RunMeshwright({"inspect", "/nowhere/scene", flag + "=" + text});
      EXPECT_EQ(result.exit_code, 2) << flag << " " << text;
      EXPECT_THAT(result.err, testing::StartsWith("meshwright: " + flag + " is " + text + ", expected a "));
      EXPECT_THAT(result.err, testing::HasSubstr(" from " + DescribeRange(option)));
    }
  }
}

TEST(CommandLineTest, ProgressGoesToStderrAndResultsToStdout) {
  const TemporaryFolder folder;
  const RunResult result =
      RunMeshwright({"reconstruct", SharedScene("small"), "-o", folder / "mesh.ply", "--max-image-size", "240"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.err, testing::HasSubstr("cameras 8/8"));
  EXPECT_THAT(result.out, testing::HasSubstr(folder / "mesh.ply"));
  EXPECT_THAT(result.out, testing::Not(testing::HasSubstr("cameras 8/8")));
  // No terminal, no control characters.
  EXPECT_THAT(result.err, testing::Not(testing::HasSubstr("\r")));
  EXPECT_THAT(result.err, testing::Not(testing::HasSubstr("\033")));
}

TEST(CommandLineTest, RenderMakesAPicture) {
  const TemporaryFolder folder;
  const std::string scene = SharedScene("small");
  const RunResult result = RunMeshwright({"render", scene + "/ground_truth.ply", "--scene", scene, "--camera",
                                          "0003.png", "--orbit-deg", "20", "-o", folder / "picture.png"});
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(ReadBytes(folder / "picture.png"), testing::StartsWith("\x89PNG"));
  const RunResult unknown = RunMeshwright(
      {"render", scene + "/ground_truth.ply", "--scene", scene, "--camera", "nobody.png", "-o", folder / "other.png"});
  EXPECT_EQ(unknown.exit_code, 3);
  EXPECT_THAT(unknown.err, testing::HasSubstr("nobody.png"));
}

}  // namespace
}  // namespace meshwright::end_to_end
