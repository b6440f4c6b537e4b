// SPDX-License-Identifier: Apache-2.0
#include "tests/end_to_end/program.h"

#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <sstream>
#include <thread>

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include "common/base/check.h"
#include "common/base/clock.h"

namespace meshwright::end_to_end {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void Become(const std::vector<std::string>& arguments, const RunSettings& settings, const std::string& out,
                         const std::string& err) {
  const int out_descriptor = ::open(out.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0644);
  const int err_descriptor = ::open(err.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0644);
  ::dup2(out_descriptor, STDOUT_FILENO);
  ::dup2(err_descriptor, STDERR_FILENO);
  if (settings.max_file_bytes.has_value()) {
    std::signal(SIGXFSZ, SIG_IGN);
    const auto bytes = static_cast<rlim_t>(*settings.max_file_bytes);
    const rlimit limit = {bytes, bytes};
    ::setrlimit(RLIMIT_FSIZE, &limit);
  }
  std::vector<char*> argv = {const_cast<char*>(MESHWRIGHT_PROGRAM)};
  for (const std::string& argument : arguments) argv.push_back(const_cast<char*>(argument.c_str()));
  argv.push_back(nullptr);
  ::execv(argv[0], argv.data());
  ::_exit(127);
}

}  // namespace

RunResult RunMeshwright(const std::vector<std::string>& arguments, const RunSettings& settings) {
  const TemporaryFolder folder;
  const std::string out = folder / "out";
  const std::string err = folder / "err";
  const Stopwatch stopwatch;
  const pid_t child = ::fork();
  MW_CHECK(child >= 0);
  if (child == 0) Become(arguments, settings, out, err);

  int status = 0;
  if (settings.kill_after_seconds.has_value()) {
    while (::waitpid(child, &status, WNOHANG) == 0) {
      if (stopwatch.Seconds() >= *settings.kill_after_seconds) {
        ::kill(child, SIGKILL);
        ::waitpid(child, &status, 0);
        break;
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
  } else {
    ::waitpid(child, &status, 0);
  }
  RunResult result;
  result.seconds = stopwatch.Seconds();
  if (WIFEXITED(status)) result.exit_code = WEXITSTATUS(status);
  if (WIFSIGNALED(status)) result.signal = WTERMSIG(status);
  result.out = ReadBytes(out);
  result.err = ReadBytes(err);
  return result;
}

nlohmann::json JsonOf(const RunResult& result) { return nlohmann::json::parse(result.out, nullptr, false); }

std::string ReadBytes(const std::string& path) {
  std::ifstream stream(path, std::ios::binary);
  std::ostringstream bytes;
  bytes << stream.rdbuf();
  return bytes.str();
}

void WriteBytes(const std::string& path, const std::string& bytes) {
  std::ofstream stream(path, std::ios::binary);
  stream << bytes;
  MW_CHECK(stream.good());
}

std::vector<std::string> ListFolder(const std::string& path) {
  std::vector<std::string> names;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(path, error)) names.push_back(entry.path().filename().string());
  std::sort(names.begin(), names.end());
  return names;
}

const std::string& SharedScene(const std::string& name) {
  static const TemporaryFolder folder;
  static std::map<std::string, std::string> made;
  static const std::map<std::string, std::vector<std::string>> kSynthesized = {
      {"small", {"facade", "--cameras", "8", "--width", "480", "--height", "360"}},
      {"turn", {"ring", "--cameras", "24", "--width", "400", "--height", "300"}},
      {"facade", {"facade"}},
      {"ring", {"ring"}},
  };
  const auto found = made.find(name);
  if (found != made.end()) return found->second;
  const std::string path = folder / name;
  std::vector<std::string> arguments = {"synthesize", "-o", path};
  const std::vector<std::string>& what = kSynthesized.at(name);
  arguments.insert(arguments.end(), what.begin(), what.end());
  const RunResult result = RunMeshwright(arguments);
  MW_CHECK(result.exit_code == 0);
  return made[name] = path;
}

}  // namespace meshwright::end_to_end
