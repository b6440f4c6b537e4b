// SPDX-License-Identifier: Apache-2.0
#include "coordinator/grpc/grpc_gate.h"

#include <memory>
#include <utility>
#include <vector>

#include <absl/strings/match.h>
#include <grpc/grpc_security_constants.h>

#include "common/base/status_macros.h"
#include "coordinator/api/public_text.h"

namespace meshwright {
namespace {

// "ipv4:10.0.0.1:5000", "ipv6:%5B::1%5D:5000" -> what stands between
std::string AddressOf(const std::string& peer) {
  const size_t begin = peer.find(':');
  const size_t end = peer.rfind(':');
  if (begin == std::string::npos || end <= begin) return peer;
  return peer.substr(begin + 1, end - begin - 1);
}

constexpr size_t kMaxNames = 64;

// What the certificate that the connection was made with says, if those trusted have signed it.
std::vector<std::string> CertifiedNames(const grpc::ServerContextBase& context) {
  std::vector<std::string> names;
  const std::shared_ptr<const grpc::AuthContext> about = context.auth_context();
  if (about == nullptr) return names;
  for (const char* property : {GRPC_X509_CN_PROPERTY_NAME, GRPC_X509_SAN_PROPERTY_NAME}) {
    for (const grpc::string_ref& name : about->FindPropertyValues(property)) {
      if (!name.empty() && names.size() < kMaxNames) names.emplace_back(name.data(), name.size());
    }
  }
  return names;
}

}  // namespace

grpc::Status ToGrpc(const absl::Status& status) {
  return {static_cast<grpc::StatusCode>(status.code()), WithoutServerPaths(std::string(status.message()))};
}

absl::StatusOr<Caller> Identify(Gatekeeper& gate, const grpc::ServerContextBase& context) {
  std::string key;
  const auto header = context.client_metadata().find("authorization");
  if (header != context.client_metadata().end()) {
    constexpr char kBearer[] = "Bearer ";
    const std::string text(header->second.data(), header->second.size());
    if (absl::StartsWith(text, kBearer)) key = text.substr(sizeof(kBearer) - 1);
  } else if (std::vector<std::string> names = CertifiedNames(context); !names.empty() && !gate.is_open()) {
    return Caller{.token_id = "client-ca-file",
                  .user = names.front(),
                  .role = Role::kWorker,
                  .address = AddressOf(context.peer()),
                  .certified_names = std::move(names)};
  }
  return gate.Identify(key, AddressOf(context.peer()));
}

absl::StatusOr<Caller> Enter(Gatekeeper& gate, const grpc::ServerContextBase& context, const Request& request) {
  MW_ASSIGN_OR_RETURN(const Caller caller, Identify(gate, context));
  MW_RETURN_IF_ERROR(gate.Check(caller, request));
  return caller;
}

bool LongCalls::Begin(const std::string& caller) {
  const MutexLock lock(mutex_);
  int& of_caller = of_[caller];
  if (all_ >= most_ || of_caller >= most_of_one_) return false;
  ++all_;
  ++of_caller;
  return true;
}

void LongCalls::End(const std::string& caller) {
  const MutexLock lock(mutex_);
  --all_;
  if (--of_[caller] == 0) of_.erase(caller);
}

}  // namespace meshwright
