// SPDX-License-Identifier: Apache-2.0
#include "tests/end_to_end/running_service.h"

#include <algorithm>
#include <cstdio>

#include <gtest/gtest.h>

namespace meshwright::end_to_end {

std::vector<std::string> With(std::vector<std::string> arguments, const std::vector<std::string>& more) {
  arguments.insert(arguments.end(), more.begin(), more.end());
  return arguments;
}

std::unique_ptr<BackgroundProgram> RunningService::StartCoordinator(const std::vector<std::string>& arguments,
                                                                    const std::string& program) {
  const std::string log = folder_ / ("coordinator-" + port_ + ".log");
  std::remove(log.c_str());
  std::vector<std::string> all = With({"--listen", "127.0.0.1:" + port_, "--lease-seconds", "2"}, arguments);
  if (std::find(all.begin(), all.end(), "--data") == all.end()) all = With(all, {"--data", folder_ / "data"});
  auto coordinator = std::make_unique<BackgroundProgram>(program, all, log);
  port_ = ListeningPort(log);
  return coordinator;
}

std::unique_ptr<BackgroundProgram> RunningService::StartWorker(const std::string& id,
                                                               const std::vector<std::string>& arguments,
                                                               const std::string& coordinator,
                                                               const std::string& program) const {
  return std::make_unique<BackgroundProgram>(
      program,
      With({"--coordinator", coordinator.empty() ? address() : coordinator, "--worker-id", id, "--cores", "1"},
           arguments),
      folder_ / (id + ".log"));
}

RunResult RunningService::Client(const std::vector<std::string>& arguments) const {
  return RunMeshwright(With(arguments, {"--coordinator", address(), "--quiet"}));
}

nlohmann::json RunningService::Status(const std::string& id) const { return JsonOf(Client({"status", id, "--json"})); }

int RunningService::Committed(const std::string& id) const {
  const nlohmann::json status = Status(id);
  return status.is_object() ? status["cameras"]["committed"].get<int>() : 0;
}

std::string RunningService::WaitForMesh(const std::string& id) const {
  const RunResult watched = Client({"watch", id, "--json"});
  EXPECT_EQ(watched.exit_code, 0) << watched.err << watched.out;
  const nlohmann::json report = JsonOf(watched);
  EXPECT_TRUE(report.is_object() && report["state"] == "done" && report["cameras"]["skipped"] == 0) << watched.out;
  const std::string path = folder_ / (id + ".fetched.ply");
  const RunResult fetched = Client({"fetch", id, "-o", path});
  EXPECT_EQ(fetched.exit_code, 0) << fetched.err;
  return fetched.exit_code == 0 ? ReadBytes(path) : "";
}

std::string RunningService::LocalMesh(const std::string& scene, const std::vector<std::string>& options) const {
  const std::string path = folder_ / "local.ply";
  const RunResult result = RunMeshwright(With({"reconstruct", scene, "-o", path, "--quiet", "--restart"}, options));
  EXPECT_EQ(result.exit_code, 0) << result.err;
  return ReadBytes(path);
}

}  // namespace meshwright::end_to_end
