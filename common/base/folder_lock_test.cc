// SPDX-License-Identifier: Apache-2.0
#include "common/base/folder_lock.h"

#include <csignal>
#include <filesystem>
#include <string>

#include <absl/status/status.h>
#include <absl/strings/str_cat.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

namespace meshwright {
namespace {

std::string EmptyFolder(const std::string& name) {
  const std::string path = absl::StrCat(testing::TempDir(), "/", name, "-", ::getpid());
  std::filesystem::remove_all(path);
  std::filesystem::create_directories(path);
  return path;
}

TEST(FolderLock, ASecondHolderIsRefusedAndTheFirstNamedUntilItLetsGo) {
  const std::string folder = EmptyFolder("folder_lock");
  {
    const auto first = FolderLock::Acquire(folder);
    ASSERT_TRUE(first.ok()) << first.status();
    const absl::Status second = FolderLock::Acquire(folder).status();
    EXPECT_EQ(second.code(), absl::StatusCode::kUnavailable);
    EXPECT_THAT(std::string(second.message()), testing::HasSubstr(absl::StrCat("process ", ::getpid(), " on ")));
  }
  EXPECT_TRUE(FolderLock::Acquire(folder).ok());
}

TEST(FolderLock, AProcessThatDiesLetsGo) {
  const std::string folder = EmptyFolder("folder_lock_of_the_dead");
  const pid_t child = ::fork();
  if (child == 0) {
    const bool held = FolderLock::Acquire(folder).ok();
    ::kill(::getpid(), held ? SIGKILL : SIGTERM);
  }
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  ASSERT_EQ(WTERMSIG(status), SIGKILL);
  EXPECT_TRUE(FolderLock::Acquire(folder).ok());
}

TEST(FolderLock, AFolderThatIsNotThereIsAnError) {
  EXPECT_FALSE(FolderLock::Acquire(EmptyFolder("gone") + "/none").ok());
}

}  // namespace
}  // namespace meshwright
