// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <absl/types/span.h>

#include "common/http_server/http_message.h"
#include "coordinator/auth/access.h"

namespace meshwright {

// One request on its way through a handler.
struct RestCall {
  const HttpRequest& request;
  HttpResponse& response;
  std::map<std::string, std::string> path;  // what stands for {name} in the route's path
  std::unique_ptr<HttpBodySink> body;       // set by TakeBody
  Caller caller = {};                       // who asks
};

// Not OK: the answer is the problem.
using RestHandler = std::function<absl::Status(RestCall& call)>;

struct Route {
  std::string method;  // GET routes answer HEAD too
  // As in the OpenAPI file. {name} stands for one segment, or for the rest when it is called {path}; "{name}:verb" for
  // a segment that ends so.
  std::string path;
  std::vector<std::string> query;  // the parameters that there are
  RestHandler handler;
};

// Finds the route and checks that the request has no other query parameters than the route, and none twice.
class Router {
 public:
  explicit Router(std::vector<Route> routes);

  // NotFound; Unimplemented with HTTP status 405 and the header Allow when only the method is wrong.
  absl::StatusOr<const Route*> Match(RestCall& call) const;
  const std::vector<Route>& routes() const { return routes_; }

 private:
  std::vector<Route> routes_;
  std::vector<std::vector<std::string>> segments_;  // of each route's path
};

// A whole number in [least, most]. InvalidArgument names the parameter.
absl::StatusOr<int64_t> PathNumber(const RestCall& call, const std::string& name, int64_t least, int64_t most);
absl::StatusOr<int64_t> QueryNumber(const RestCall& call, const std::string& name, int64_t least, int64_t most,
                                    int64_t otherwise);
// "true" or "false".
absl::StatusOr<bool> QueryFlag(const RestCall& call, const std::string& name);

// Asks for the request's body, which `take` then gets in pieces as they arrive; `finish` answers when it was all taken.
// An error of either is the answer. HTTP status 415 for bodies that are encoded or in several parts; bodies above
// `most` bytes get 413 by themselves.
absl::Status TakeBody(RestCall& call, int64_t most, std::function<absl::Status(absl::Span<const uint8_t>)> take,
                      std::function<absl::Status(RestCall&)> finish);

// Makes `response` the problem that `status` is, if it is one.
void AnswerStatus(const absl::Status& status, HttpResponse& response);

}  // namespace meshwright
