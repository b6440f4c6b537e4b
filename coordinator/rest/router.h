#pragma once

#include <functional>
#include <map>
#include <string>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <absl/types/span.h>
#include <httplib.h>

namespace meshwright {

// One request on its way through a handler.
struct RestCall {
  const httplib::Request& request;
  httplib::Response& response;
  const httplib::ContentReader* content = nullptr;  // null when the request has no body
  std::map<std::string, std::string> path;          // what stands for {name} in the route's path
  bool content_read = false;
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

// Hands the body to `take` in pieces. InvalidArgument when it ends early, HTTP status 413 above `most` bytes, 415 for
// bodies that are encoded or in several parts.
absl::Status ReadContent(RestCall& call, int64_t most,
                         const std::function<absl::Status(absl::Span<const uint8_t>)>& take);

// The connection ends with the answer: what the client goes on sending must not be taken for its next request.
void CloseAfterwards(RestCall& call);

}  // namespace meshwright
