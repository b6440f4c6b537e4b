// SPDX-License-Identifier: Apache-2.0
#include "tests/end_to_end/background_program.h"

#include <csignal>

#include <fcntl.h>
#include <sys/wait.h>
#include <unistd.h>

#include "common/base/check.h"
#include "tests/end_to_end/program.h"

namespace meshwright::end_to_end {

BackgroundProgram::BackgroundProgram(const std::string& program, const std::vector<std::string>& arguments,
                                     const std::string& log)
    : child_(::fork()) {
  MW_CHECK(child_ >= 0);
  if (child_ > 0) return;
  const int descriptor = ::open(log.c_str(), O_WRONLY | O_CREAT | O_APPEND, 0644);
  ::dup2(descriptor, STDOUT_FILENO);
  ::dup2(descriptor, STDERR_FILENO);
  std::vector<char*> argv = {const_cast<char*>(program.c_str())};
  for (const std::string& argument : arguments) argv.push_back(const_cast<char*>(argument.c_str()));
  argv.push_back(nullptr);
  ::execv(argv[0], argv.data());
  ::_exit(127);
}

BackgroundProgram::~BackgroundProgram() { Stop(SIGKILL); }

void BackgroundProgram::Signal(int signal) const {
  if (child_ >= 0) ::kill(child_, signal);
}

int BackgroundProgram::Stop(int signal) {
  if (child_ < 0) return -1;
  ::kill(child_, signal);
  int status = -1;
  ::waitpid(child_, &status, 0);
  child_ = -1;
  return status;
}

std::string ListeningPort(const std::string& log, const std::string& said) {
  std::string text;
  const bool heard = WaitUntil(
      [&] {
        text = ReadBytes(log);
        const size_t place = text.find(said);
        return place != std::string::npos && text.find('\n', place) != std::string::npos;
      },
      60);
  MW_CHECK(heard);
  const size_t begin = text.find(said) + said.size();
  return text.substr(begin, text.find_first_not_of("0123456789", begin) - begin);
}

}  // namespace meshwright::end_to_end
