#pragma once

#include <memory>
#include <string>

#include <CLI/CLI.hpp>

#include "clients/cpp/service_client.h"
#include "program/console.h"

namespace meshwright {

// Of every command that talks to a coordinator: --coordinator and --grpc-token-file, also from the environment.
struct ServiceArguments {
  std::string coordinator = "127.0.0.1:7420";
  std::string token;
  OutputSettings output;

  std::unique_ptr<ServiceClient> Connect() const { return ServiceClient::Connect(coordinator, token); }
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
// SPDX-License-Identifier: Apache-2.0
