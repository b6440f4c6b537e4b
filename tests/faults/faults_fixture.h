// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdlib>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "tests/end_to_end/running_service.h"

namespace meshwright::faults {

// A service as real processes, and a scene of 24 photographs whose mesh it has to make whatever happens meanwhile.
class FaultsTest : public testing::Test {
 protected:
  const std::string& scene() const { return end_to_end::SharedScene("turn"); }

  // What all of them have to make.
  const std::string& Expected() const {
    static std::map<std::vector<std::string>, std::string> meshes;
    std::string& mesh = meshes[options_];
    if (mesh.empty()) mesh = end_to_end::RunningService().LocalMesh(scene(), options_);
    return mesh;
  }
  void Submit() {
    const auto submitted = service_.Client(end_to_end::With({"submit", scene(), "--id", "turn"}, options_));
    ASSERT_EQ(submitted.exit_code, 0) << submitted.err;
  }
  bool Reaches(int commits, double seconds = 120) {
    return end_to_end::WaitUntil([&] { return service_.Committed("turn") >= commits; }, seconds);
  }
  bool IsOver() const {
    const nlohmann::json status = service_.Status("turn");
    return status.is_object() && status["state"] == "done";
  }
  int port() const { return std::stoi(service_.address().substr(service_.address().find(':') + 1)); }

  end_to_end::RunningService service_;
  std::vector<std::string> options_ = {"--lattice-step", "1"};
};

// Variables that programs which are started meanwhile have.
class Environment {
 public:
  explicit Environment(std::vector<std::pair<std::string, std::string>> variables) : variables_(std::move(variables)) {
    for (const auto& [name, value] : variables_) ::setenv(name.c_str(), value.c_str(), 1);
  }
  ~Environment() {
    for (const auto& [name, value] : variables_) ::unsetenv(name.c_str());
  }
  Environment(const Environment&) = delete;
  Environment& operator=(const Environment&) = delete;

 private:
  const std::vector<std::pair<std::string, std::string>> variables_;
};

}  // namespace meshwright::faults
