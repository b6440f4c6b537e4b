// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>

#include "clients/cpp/service_client.h"
#include "meshwright/v1/worker.grpc.pb.h"

#include "tests/rest/rest_cluster.h"
#include "worker/agent/grpc_coordinator.h"

namespace meshwright {

inline constexpr char kRoot[] = "the-operators-key-0123456789";
inline constexpr char kJoin[] = "the-workers-key-0123456789";

// A coordinator that asks for keys, with an operator and a key that workers join with.
class AccessCluster : public RestCluster {
 protected:
  void SetUp() override {
    RestCluster::SetUp();
    Stop();
    MW_CHECK(WriteFileAtomically(folder_ + "/root", std::string(kRoot) + "\n").ok());
    MW_CHECK(WriteFileAtomically(folder_ + "/join", std::string(kJoin) + "\n").ok());
    settings_.api_token_file = folder_ + "/root";
    settings_.worker_token_file = folder_ + "/join";
    settings_.user_requests_per_second = 10'000;
    Start();
  }

  std::unique_ptr<ServiceClient> Grpc(const std::string& key) {
    return ServiceClient::Connect(absl::StrCat("127.0.0.1:", coordinator_->port()), {.key = key});
  }
  std::string Key(const std::string& user, v1::Role role, int64_t seconds = 0) {
    v1::CreateKeyRequest request;
    request.set_user(user);
    request.set_role(role);
    if (seconds > 0) request.mutable_lifetime()->set_seconds(seconds);
    const auto key = Grpc(kRoot)->CreateKey(request);
    MW_CHECK(key.ok());
    return key->text();
  }
  static httplib::Headers Bearer(const std::string& key) { return {{"Authorization", "Bearer " + key}}; }
  int Get(const std::string& path, const std::string& key) { return http_->Get(path, Bearer(key))->status; }
  int Create(const std::string& id, const std::string& key) {
    return http_->Post("/v1/reconstructions", Bearer(key), R"({"id":")" + id + R"("})", "application/json")->status;
  }
  static v1::SynchronizeRequest WorkerRequest(const std::string& id = "w", const std::string& instance = "1") {
    v1::SynchronizeRequest request;
    request.set_worker_id(id);
    request.set_instance(instance);
    request.set_cores(1);
    request.set_memory_bytes(1 << 20);
    return request;
  }
  absl::Status Synchronize(const std::string& key, const v1::SynchronizeRequest& request) const {
    return GrpcCoordinator::Connect(absl::StrCat("127.0.0.1:", coordinator_->port()), {.key = key})
        ->Synchronize(request)
        .status();
  }
  // As a worker that bears the key's own name, so that keys do not get into each other's way.
  absl::Status Synchronize(const std::string& key) const { return Synchronize(key, WorkerRequest(key.substr(0, 20))); }
};

}  // namespace meshwright
