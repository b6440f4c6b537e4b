// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>

#include <CLI/CLI.hpp>

#include "clients/cpp/service_client.h"
#include "program/console.h"

namespace meshwright {

// Of every command that talks to a coordinator: --coordinator, --token-file and --ca-file, or MESHWRIGHT_COORDINATOR
// and so on.
struct ServiceArguments {
  std::string coordinator = "127.0.0.1:7420";
  std::string token_file;
  std::string ca_file;
  OutputSettings output;

  // A file that cannot be read is said on stderr; the coordinator then cannot be reached, or does not answer.
  std::unique_ptr<ServiceClient> Connect() const;
};
void AddServiceOptions(CLI::App& command, ServiceArguments& arguments);

// As Fail. Where no coordinator answers it says how to start one.
int FailCall(const absl::Status& status, const ServiceArguments& arguments);

// "running", "done".
std::string NameOf(v1::ReconstructionState state);
// What --json prints.
nlohmann::ordered_json ToJson(const v1::Reconstruction& reconstruction);
// Shows progress on stderr until the reconstruction is over; the exit code says how it ended.
int WatchUntilOver(const ServiceArguments& arguments, ServiceClient& client, const std::string& id);

}  // namespace meshwright
