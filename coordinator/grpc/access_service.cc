// SPDX-License-Identifier: Apache-2.0
#include "coordinator/grpc/access_service.h"

#include <utility>

#include <google/protobuf/util/time_util.h>

#include "meshwright/v1/access.grpc.pb.h"

#include "coordinator/grpc/grpc_gate.h"

namespace meshwright {
namespace {

using google::protobuf::util::TimeUtil;

constexpr std::pair<Role, v1::Role> kRoles[] = {{Role::kViewer, v1::ROLE_VIEWER},
                                                {Role::kSubmitter, v1::ROLE_SUBMITTER},
                                                {Role::kOperator, v1::ROLE_OPERATOR},
                                                {Role::kWorker, v1::ROLE_WORKER}};

void Fill(const AccessToken& token, v1::Key& key) {
  key.set_id(token.id);
  key.set_user(token.user);
  for (const auto& [role, proto] : kRoles) {
    if (token.role == NameOf(role)) key.set_role(proto);
  }
  key.set_reconstruction_id(token.reconstruction_id);
  const auto micros = [](absl::Time time) { return TimeUtil::MicrosecondsToTimestamp(absl::ToUnixMicros(time)); };
  *key.mutable_create_time() = micros(token.created_at);
  if (token.expires_at != absl::InfiniteFuture()) *key.mutable_expire_time() = micros(token.expires_at);
  if (token.revoked_at != absl::InfiniteFuture()) *key.mutable_revoke_time() = micros(token.revoked_at);
}

absl::StatusOr<KeyRequest> Read(const v1::CreateKeyRequest& request) {
  KeyRequest read = {.user = request.user(), .reconstruction = request.reconstruction_id()};
  bool is_role = false;
  for (const auto& [role, proto] : kRoles) {
    if (request.role() != proto) continue;
    read.role = role;
    is_role = true;
  }
  if (!is_role) return absl::InvalidArgumentError("role: expected viewer, submitter, operator or worker");
  if (request.has_lifetime()) read.lifetime = absl::Seconds(request.lifetime().seconds());
  return read;
}

// What each call does is told and checked by the gate itself.
class AccessServiceImpl final : public v1::AccessService::Service {
 public:
  explicit AccessServiceImpl(Gatekeeper& gate) : gate_(gate) {}

  grpc::Status CreateKey(grpc::ServerContext* context, const v1::CreateKeyRequest* request,
                         v1::CreateKeyResponse* response) override {
    return Guarded(gate_, *context, {.action = Action::kRead, .deed = "CreateKey"}, [&](const Caller& caller) {
      const absl::StatusOr<KeyRequest> wanted = Read(*request);
      if (!wanted.ok()) return ToGrpc(wanted.status());
      const absl::StatusOr<NewKey> key = gate_.Create(caller, *wanted);
      if (!key.ok()) return ToGrpc(key.status());
      Fill(key->token, *response->mutable_key());
      response->set_text(key->text);
      return grpc::Status::OK;
    });
  }
  grpc::Status ListKeys(grpc::ServerContext* context, const v1::ListKeysRequest*,
                        v1::ListKeysResponse* response) override {
    return Guarded(gate_, *context, {.action = Action::kList, .deed = "ListKeys"}, [&](const Caller& caller) {
      const absl::StatusOr<std::vector<AccessToken>> keys = gate_.List(caller);
      if (!keys.ok()) return ToGrpc(keys.status());
      for (const AccessToken& token : *keys) Fill(token, *response->add_keys());
      return grpc::Status::OK;
    });
  }
  grpc::Status RevokeKey(grpc::ServerContext* context, const v1::RevokeKeyRequest* request,
                         v1::RevokeKeyResponse*) override {
    return Guarded(gate_, *context, {.action = Action::kRead, .deed = "RevokeKey"},
                   [&](const Caller& caller) { return ToGrpc(gate_.Revoke(caller, request->id())); });
  }

 private:
  Gatekeeper& gate_;
};

}  // namespace

std::unique_ptr<grpc::Service> MakeAccessService(Gatekeeper& gate) { return std::make_unique<AccessServiceImpl>(gate); }

}  // namespace meshwright
