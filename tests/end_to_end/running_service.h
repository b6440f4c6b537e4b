// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "tests/end_to_end/background_program.h"
#include "tests/end_to_end/program.h"

namespace meshwright::end_to_end {

std::vector<std::string> With(std::vector<std::string> arguments, const std::vector<std::string>& more);

// The service as real processes on this machine. Everything is in one folder, removed at the end.
class RunningService {
 public:
  const TemporaryFolder& folder() const { return folder_; }
  std::string address() const { return "127.0.0.1:" + port_; }

  // A coordinator on a free port, at the next start on the same one again, with its state in folder() / "data" unless
  // `arguments` name another place. The clients below speak to the one that was started last.
  // `program`: of another version.
  std::unique_ptr<BackgroundProgram> StartCoordinator(const std::vector<std::string>& arguments = {},
                                                      const std::string& program = MESHWRIGHT_COORDINATOR);
  // For a second coordinator: the next one gets a port of its own.
  void ForgetPort() { port_ = "0"; }
  // `coordinator`: "": address().
  std::unique_ptr<BackgroundProgram> StartWorker(const std::string& id, const std::vector<std::string>& arguments = {},
                                                 const std::string& coordinator = "",
                                                 const std::string& program = MESHWRIGHT_WORKER) const;

  // `meshwright ARGUMENTS --coordinator address() --quiet`.
  RunResult Client(const std::vector<std::string>& arguments) const;
  nlohmann::json Status(const std::string& id) const;
  int Committed(const std::string& id) const;
  // Bytes of the mesh, once the reconstruction is over; "" and a failed expectation when there is none.
  std::string WaitForMesh(const std::string& id) const;
  // What one process makes of it.
  std::string LocalMesh(const std::string& scene, const std::vector<std::string>& options) const;

 private:
  const TemporaryFolder folder_;
  std::string port_ = "0";
};

}  // namespace meshwright::end_to_end
