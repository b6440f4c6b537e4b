// SPDX-License-Identifier: Apache-2.0
// Settings from files and from the environment, and what is said of wrong ones.

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <random>
#include <string>

#include <CLI/CLI.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "program/console.h"
#include "program/environment.h"
#include "program/parse_program.h"
#include "program/program_options.h"
#include "program/settings_file.h"
#include "program/usage_error.h"

namespace meshwright {
namespace {

using testing::HasSubstr;

// A program with a few settings, as the long-running ones have them.
struct Program {
  Program() : app("A program.", "program") {
    NameInEnvironment(app.add_option("--api-token-file", token_file, ""));
    NameInEnvironment(app.add_option("--cores", cores, "")->check(CLI::Range(1, 64)));
    NameInEnvironment(app.add_option("--scene-root", roots, "")->delimiter(':'));
  }
  // The exit code; -1: the program may go on.
  int Parse(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), "program");
    std::vector<char*> argv;
    for (std::string& argument : arguments) argv.push_back(argument.data());
    testing::internal::CaptureStderr();
    const auto check = [this] { return cores == 13 ? absl::InvalidArgumentError("--cores is 13") : absl::OkStatus(); };
    const int code = ParseProgram(app, static_cast<int>(argv.size()), argv.data(), check).value_or(-1);
    said = testing::internal::GetCapturedStderr();
    return code;
  }

  CLI::App app;
  std::string token_file;
  int cores = 1;
  std::vector<std::string> roots;
  std::string said;
};

class SettingsTest : public testing::Test {
 protected:
  void TearDown() override {
    for (const char* name :
         {"MESHWRIGHT_CORES", "MESHWRIGHT_API_TOKEN_FIEL", "MESHWRIGHT_CONFIG", "MESHWRIGHT_COORDINATOR_SERVICE_HOST",
          "MESHWRIGHT_COORDINATOR_PORT_7420_TCP_ADDR", "MESHWRIGHT_WORKER_ID"}) {
      ::unsetenv(name);
    }
  }
  std::string Write(const std::string& text) {
    const std::string path = testing::TempDir() + "program.conf";
    std::ofstream(path, std::ios::binary) << text;
    return path;
  }
};

TEST_F(SettingsTest, TheCommandLineWinsOverTheEnvironmentAndThatOverTheFile) {
  const std::string file = Write("cores = 2\napi-token-file = '/a b'\n# cores = 9\n\n; x\nscene-root = /a:/b\r\n");
  Program from_file;
  EXPECT_EQ(from_file.Parse({"--config", file}), -1) << from_file.said;
  EXPECT_EQ(from_file.cores, 2);
  EXPECT_EQ(from_file.token_file, "/a b");
  EXPECT_THAT(from_file.roots, testing::ElementsAre("/a", "/b"));
  ::setenv("MESHWRIGHT_CORES", "3", 1);
  ::setenv("MESHWRIGHT_CONFIG", file.c_str(), 1);
  Program from_environment;
  EXPECT_EQ(from_environment.Parse({}), -1) << from_environment.said;
  EXPECT_EQ(from_environment.cores, 3);
  EXPECT_EQ(from_environment.token_file, "/a b");
  Program from_line;
  EXPECT_EQ(from_line.Parse({"--cores", "4"}), -1) << from_line.said;
  EXPECT_EQ(from_line.cores, 4);
}

TEST_F(SettingsTest, AnUnknownSettingIsWrongUseWithTheNearest) {
  Program in_file;
  EXPECT_EQ(in_file.Parse({"--config", Write("cores = 2\napi-token-fiel = /x\n")}), kExitWrongUse);
  EXPECT_THAT(in_file.said,
              HasSubstr("program.conf:2: there is no setting api-token-fiel, did you mean api-token-file?"));
  Program on_line;
  EXPECT_EQ(on_line.Parse({"--api-token-fiel", "/x"}), kExitWrongUse);
  EXPECT_THAT(on_line.said, HasSubstr("there is no option --api-token-fiel, did you mean --api-token-file?"));
  ::setenv("MESHWRIGHT_API_TOKEN_FIEL", "/x", 1);
  Program in_environment;
  EXPECT_EQ(in_environment.Parse({}), kExitWrongUse);
  EXPECT_THAT(in_environment.said,
              HasSubstr("there is no setting MESHWRIGHT_API_TOKEN_FIEL, did you mean MESHWRIGHT_API_TOKEN_FILE?"));
  // Help is to be had all the same.
  Program help;
  testing::internal::CaptureStdout();
  EXPECT_EQ(help.Parse({"--help"}), kExitDone);
  EXPECT_THAT(testing::internal::GetCapturedStdout(), HasSubstr("MESHWRIGHT_API_TOKEN_FILE"));
}

TEST_F(SettingsTest, OtherProgramsAndServiceDiscoveryMayHaveTheirVariables) {
  ::setenv("MESHWRIGHT_COORDINATOR_SERVICE_HOST", "10.0.0.1", 1);
  ::setenv("MESHWRIGHT_COORDINATOR_PORT_7420_TCP_ADDR", "10.0.0.1", 1);
  ::setenv("MESHWRIGHT_WORKER_ID", "w", 1);
  ::setenv("MESHWRIGHT_CORES", "", 1);  // says nothing
  Program program;
  EXPECT_EQ(program.Parse({}), -1) << program.said;
  EXPECT_EQ(program.cores, 1);
}

TEST_F(SettingsTest, AWrongValueIsNamedWithWhereItIsSaid) {
  Program in_file;
  EXPECT_EQ(in_file.Parse({"--config", Write("cores = 0\n")}), kExitWrongUse);
  EXPECT_THAT(in_file.said, testing::AllOf(HasSubstr("--cores"), HasSubstr("program.conf:1)")));
  ::setenv("MESHWRIGHT_CORES", "13", 1);
  Program in_environment;
  EXPECT_EQ(in_environment.Parse({"--check"}), kExitWrongUse);
  EXPECT_THAT(in_environment.said, HasSubstr("--cores is 13 (in MESHWRIGHT_CORES)"));
}

TEST_F(SettingsTest, CheckSaysThatAllIsGood) {
  Program program;
  testing::internal::CaptureStdout();
  EXPECT_EQ(program.Parse({"--check", "--cores=2"}), kExitDone);
  EXPECT_EQ(testing::internal::GetCapturedStdout(), "the settings of program are good\n");
}

TEST_F(SettingsTest, AFileThatCannotBeReadIsAnError) {
  Program program;
  EXPECT_EQ(program.Parse({"--config", "/nowhere/program.conf"}), kExitWrongUse);
  EXPECT_THAT(program.said, HasSubstr("/nowhere/program.conf"));
}

TEST_F(SettingsTest, LinesThatSayNothingClearAreRefused) {
  for (const char* text : {"cores\n", "= 3\n", "[section]\n", "co res = 3\n", "CORES = 3\n", "cores = 3\ncores = 4\n",
                           "check = true\n", "config = x\n", "help = 1\n", "cores : 3\n", "cores = 3\x01\n"}) {
    Program program;
    EXPECT_EQ(program.Parse({"--config", Write(text)}), kExitWrongUse) << text;
  }
}

TEST_F(SettingsTest, NoiseIsNoConfiguration) {
  std::mt19937 random(7);
  int refused = 0;
  for (int i = 0; i < 200; ++i) {
    std::string noise(3000, '\0');
    for (char& c : noise) c = static_cast<char>(random());
    refused += ParseSettingsFile("noise", noise).ok() ? 0 : 1;
  }
  EXPECT_EQ(refused, 200);
  EXPECT_FALSE(ParseSettingsFile("long", std::string((size_t{1} << 20) + 1, '\n')).ok());
}

TEST(UsageErrorTest, UnknownCommandsAndOptionsAreNamedWithTheNearest) {
  const auto said = [](std::vector<std::string> arguments) {
    CLI::App program("A program.", "program");
    program.require_subcommand(1);
    CLI::App& reconstruct = *program.add_subcommand("reconstruct", "");
    std::string output;
    reconstruct.add_option("-o,--output", output, "")->required();
    program.add_subcommand("inspect", "");
    std::reverse(arguments.begin(), arguments.end());
    try {
      program.parse(arguments);
    } catch (const CLI::ParseError& error) {
      return DescribeUsageError(program, error);
    }
    return std::string("good");
  };
  EXPECT_EQ(said({"reconstrukt"}), "there is no command reconstrukt, did you mean reconstruct?");
  EXPECT_EQ(said({"paint"}), "there is no command paint");
  EXPECT_EQ(said({}), "a command is expected: reconstruct, inspect");
  EXPECT_EQ(said({"reconstruct", "--ouput", "x"}), "there is no option --ouput, did you mean --output?");
  EXPECT_EQ(said({"reconstruct", "--ouput=x"}), "there is no option --ouput, did you mean --output?");
  EXPECT_EQ(said({"reconstruct", "-o", "x", "--nonsense"}), "there is no option --nonsense");
  EXPECT_THAT(said({"reconstruct"}), HasSubstr("--output is required"));
  EXPECT_EQ(said({"reconstruct", "-o", "x"}), "good");
}

}  // namespace
}  // namespace meshwright
