#include "coordinator/rest/rest_server.h"

#include <limits>
#include <thread>
#include <utility>

#include <absl/strings/match.h>
#include <absl/strings/numbers.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_split.h>
#include <absl/strings/strip.h>

#include "common/base/digest.h"
#include "common/base/status_macros.h"
#include "coordinator/rest/problem.h"
#include "coordinator/rest/routes.h"
#include "coordinator/rest/static_pages.h"

namespace meshwright {
namespace {

constexpr char kProblemType[] = "application/problem+json";
constexpr char kTokenCookie[] = "meshwright-token";
// Each event stream holds a thread, and so does each connection that a client keeps for its next request.
constexpr int kOtherConnections = 64;
constexpr size_t kRequestsPerConnection = 1000;
constexpr int64_t kMaxIgnoredBytes = int64_t{1} << 20;

struct Address {
  std::string host;
  int port = 0;
};

absl::StatusOr<Address> ParseAddress(const std::string& text) {
  const size_t colon = text.rfind(':');
  Address address;
  if (colon == std::string::npos || colon == 0 || !absl::SimpleAtoi(text.substr(colon + 1), &address.port) ||
      address.port < 0 || address.port > std::numeric_limits<uint16_t>::max()) {
    return absl::InvalidArgumentError(absl::StrCat("rest-listen is \"", text, "\", expected host:port"));
  }
  address.host = text.substr(0, colon);
  if (absl::StartsWith(address.host, "[") && absl::EndsWith(address.host, "]")) {
    address.host = address.host.substr(1, address.host.size() - 2);
  }
  return address;
}

std::string TokenOf(const httplib::Request& request) {
  const std::string header = request.get_header_value("Authorization");
  constexpr char kBearer[] = "Bearer ";
  if (absl::StartsWith(header, kBearer)) return header.substr(sizeof(kBearer) - 1);
  for (absl::string_view cookie : absl::StrSplit(request.get_header_value("Cookie"), ';')) {
    cookie = absl::StripAsciiWhitespace(cookie);
    if (absl::ConsumePrefix(&cookie, kTokenCookie) && absl::ConsumePrefix(&cookie, "=")) return std::string(cookie);
  }
  return "";
}

// Whether the request is another site's doing, in the browser of somebody who can reach this one.
bool IsForeign(const httplib::Request& request) {
  if (request.method == "GET" || request.method == "HEAD") return false;
  const std::string origin = request.get_header_value("Origin");
  const size_t host = origin.find("://");
  return !origin.empty() && (host == std::string::npos || origin.substr(host + 3) != request.get_header_value("Host"));
}

bool HasBody(const httplib::Request& request) {
  const std::string length = request.get_header_value("Content-Length");
  return request.has_header("Transfer-Encoding") || (!length.empty() && length != "0");
}

class RealRestServer final : public RestServer {
 public:
  RealRestServer(const RestOptions& options, const RestServices& services)
      : options_(options), token_digest_(Sha256Hex(options.token)) {
    context_.reconstructions = services.reconstructions;
    context_.workers = services.workers;
    context_.blobs = services.blobs;
    context_.ready = services.ready;
    context_.options_json = services.options_json;
  }
  ~RealRestServer() override { Shutdown(); }

  absl::Status Open() {
    MW_ASSIGN_OR_RETURN(uploads_, SceneUploads::Open(options_.folder + "/uploads", *context_.reconstructions));
    MW_ASSIGN_OR_RETURN(derived_, DerivedFiles::Open(options_.folder + "/derived"));
    feeds_ = std::make_unique<EventFeeds>(*context_.reconstructions,
                                          EventFeedOptions{.max_streams = options_.max_event_streams});
    context_.uploads = uploads_.get();
    context_.derived = derived_.get();
    context_.feeds = feeds_.get();
    router_ = std::make_unique<Router>(MakeRoutes(context_));
    SetUpServer();
    return Listen();
  }

  int port() const override { return port_; }

  void Shutdown() override {
    if (feeds_ != nullptr) feeds_->Shutdown();
    server_.stop();
    if (listener_.joinable()) listener_.join();
  }

 private:
  void SetUpServer() {
    server_.new_task_queue = [threads = static_cast<size_t>(options_.max_event_streams + kOtherConnections)] {
      return new httplib::ThreadPool(threads);
    };
    server_.set_read_timeout(options_.idle_timeout_seconds);
    server_.set_write_timeout(options_.idle_timeout_seconds);
    server_.set_keep_alive_max_count(kRequestsPerConnection);
    server_.set_tcp_nodelay(true);  // events are small and must not wait for each other
    // The default shares the port with whoever else asks for it: two coordinators would answer in turns.
    server_.set_socket_options([](socket_t socket) {
      const int yes = 1;
      ::setsockopt(socket, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof(yes));
    });
    server_.set_default_headers({{"X-Content-Type-Options", "nosniff"}, {"Referrer-Policy", "no-referrer"}});
    server_.set_pre_routing_handler([this](const httplib::Request& request, httplib::Response& response) {
      // Ranges are answered by SendFile, which knows conditions; the library would cut every answer to size. The
      // request is not a constant object.
      const_cast<httplib::Request&>(request).ranges.clear();
      if (request.method == "POST" || request.method == "PUT" || request.method == "PATCH" ||
          request.method == "DELETE") {
        return httplib::Server::HandlerResponse::Unhandled;  // with a reader of the body, below
      }
      Dispatch(request, response, nullptr);
      return httplib::Server::HandlerResponse::Handled;
    });
    const auto with_body = [this](const httplib::Request& request, httplib::Response& response,
                                  const httplib::ContentReader& reader) {
      Dispatch(request, response, HasBody(request) ? &reader : nullptr);
    };
    server_.Post(".*", with_body);
    server_.Put(".*", with_body);
    server_.Patch(".*", with_body);
    server_.Delete(".*", with_body);
    server_.set_error_handler([](const httplib::Request&, httplib::Response& response) {
      if (response.body.empty() && response.content_length_ == 0) {
        response.set_content(ProblemJson(StatusOfHttp(response.status)), kProblemType);
      }
    });
    server_.set_exception_handler([](const httplib::Request&, httplib::Response& response, const std::exception_ptr&) {
      response.status = 500;
      response.set_content(ProblemJson(absl::InternalError("the request could not be answered")), kProblemType);
    });
  }

  absl::Status Listen() {
    MW_ASSIGN_OR_RETURN(const Address address, ParseAddress(options_.listen));
    if (address.port == 0) {
      port_ = server_.bind_to_any_port(address.host);
    } else {
      port_ = server_.bind_to_port(address.host, address.port) ? address.port : -1;
    }
    if (port_ <= 0) return absl::UnavailableError(absl::StrCat("cannot listen on ", options_.listen));
    listener_ = std::thread([this] { server_.listen_after_bind(); });
    // stop() does nothing before the server runs.
    while (!server_.is_running()) std::this_thread::yield();
    return absl::OkStatus();
  }

  void Dispatch(const httplib::Request& request, httplib::Response& response, const httplib::ContentReader* content) {
    RestCall call = {.request = request, .response = response, .content = content};
    if (const absl::Status status = Answer(call); !status.ok()) {
      response.status = HttpStatusOf(status);
      if (response.status == 401) response.set_header("WWW-Authenticate", "Bearer");
      response.set_content(ProblemJson(status), kProblemType);
    } else if (response.status == -1) {
      response.status = 200;
    }
    // What nobody read must not be taken for the next request.
    if (call.content != nullptr && !call.content_read) {
      const int http_status = response.status;
      ReadContent(call, kMaxIgnoredBytes, [](absl::Span<const uint8_t>) { return absl::OkStatus(); }).IgnoreError();
      response.status = http_status;
    }
  }

  absl::Status Answer(RestCall& call) {
    const httplib::Request& request = call.request;
    const bool for_interface = request.path == "/v1" || absl::StartsWith(request.path, "/v1/");
    if (call.content == nullptr && (request.method == "GET" || request.method == "HEAD") && HasBody(request)) {
      CloseAfterwards(call);
      return absl::InvalidArgumentError(absl::StrCat("the body is there, expected none with ", request.method));
    }
    if (for_interface && !options_.token.empty() && Sha256Hex(TokenOf(request)) != token_digest_) {
      return absl::UnauthenticatedError("the header Authorization is not the one expected: Bearer and the token");
    }
    if (IsForeign(request)) {
      return FieldError("Origin", absl::PermissionDeniedError("Origin is another site, expected this one or none"));
    }
    const absl::StatusOr<const Route*> route = router_->Match(call);
    if (route.ok()) return (*route)->handler(call);
    if (!absl::IsNotFound(route.status()) || for_interface || (request.method != "GET" && request.method != "HEAD")) {
      return route.status();
    }
    return SendPage(call, options_.page_folder);
  }

  const RestOptions options_;
  const std::string token_digest_;
  RestContext context_;
  std::unique_ptr<SceneUploads> uploads_;
  std::unique_ptr<DerivedFiles> derived_;
  std::unique_ptr<EventFeeds> feeds_;
  std::unique_ptr<Router> router_;
  httplib::Server server_;
  int port_ = 0;
  std::thread listener_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<RestServer>> RestServer::Start(const RestOptions& options,
                                                              const RestServices& services) {
  auto server = std::make_unique<RealRestServer>(options, services);
  MW_RETURN_IF_ERROR(server->Open());
  return server;
}

}  // namespace meshwright
