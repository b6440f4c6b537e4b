// SPDX-License-Identifier: Apache-2.0
#include "coordinator/rest/router.h"

#include <algorithm>
#include <set>
#include <utility>

#include <absl/strings/match.h>
#include <absl/strings/numbers.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>
#include <absl/strings/str_split.h>

#include "coordinator/rest/problem.h"

namespace meshwright {
namespace {

constexpr char kRest[] = "{path}";
constexpr size_t kQuoted = 64;

std::vector<std::string> Segments(const std::string& path) { return absl::StrSplit(path, '/'); }

// Whether `segment` of a request fits `pattern`; adds what stands for its name.
bool Fits(const std::string& pattern, const std::string& segment, std::map<std::string, std::string>& values) {
  if (pattern.empty() || pattern.front() != '{') return pattern == segment;
  const size_t end = pattern.find('}');
  const std::string suffix = pattern.substr(end + 1);
  if (segment.size() <= suffix.size() || !absl::EndsWith(segment, suffix)) return false;
  values[pattern.substr(1, end - 1)] = segment.substr(0, segment.size() - suffix.size());
  return true;
}

bool Fits(const std::vector<std::string>& pattern, const std::vector<std::string>& segments,
          std::map<std::string, std::string>& values) {
  values.clear();
  const bool takes_rest = pattern.back() == kRest;
  if (takes_rest ? segments.size() < pattern.size() : segments.size() != pattern.size()) return false;
  const size_t count = takes_rest ? pattern.size() - 1 : pattern.size();
  for (size_t i = 0; i < count; ++i) {
    if (!Fits(pattern[i], segments[i], values)) return false;
  }
  if (takes_rest) {
    values["path"] = absl::StrJoin(segments.begin() + static_cast<ptrdiff_t>(count), segments.end(), "/");
  }
  return true;
}

absl::Status CheckQuery(const Route& route, const HttpRequest& request) {
  for (auto it = request.params.begin(); it != request.params.end(); ++it) {
    const std::string name = it->first.substr(0, kQuoted);
    if (std::find(route.query.begin(), route.query.end(), it->first) == route.query.end()) {
      return FieldError(name, absl::InvalidArgumentError(absl::StrCat(
                                  name, " is no parameter of ", route.method, " ", route.path, ", expected ",
                                  route.query.empty() ? "none" : absl::StrJoin(route.query, ", "))));
    }
    if (std::next(it) != request.params.end() && std::next(it)->first == it->first) {
      return FieldError(name, absl::InvalidArgumentError(absl::StrCat(name, " is given twice, expected once")));
    }
  }
  return absl::OkStatus();
}

absl::StatusOr<int64_t> Number(const std::string& name, const std::string& text, int64_t least, int64_t most) {
  int64_t value = 0;
  // SimpleAtoi would take blanks and a plus sign.
  const bool digits =
      !text.empty() && text.find_first_not_of("0123456789", text[0] == '-' ? 1 : 0) == std::string::npos;
  if (!digits || !absl::SimpleAtoi(text, &value) || value < least || value > most) {
    return FieldError(name,
                      absl::InvalidArgumentError(absl::StrCat(name, " is \"", text.substr(0, kQuoted),
                                                              "\", expected a whole number ", least, "..", most)));
  }
  return value;
}

class RestBody final : public HttpBodySink {
 public:
  RestBody(const RestCall& call, int64_t most, std::function<absl::Status(absl::Span<const uint8_t>)> take,
           std::function<absl::Status(RestCall&)> finish)
      : call_{.request = call.request, .response = call.response, .path = call.path, .caller = call.caller},
        most_(most),
        take_(std::move(take)),
        finish_(std::move(finish)) {}

  int64_t max_bytes() const override { return most_; }
  bool Take(absl::Span<const uint8_t> bytes) override {
    status_ = take_(bytes);
    return status_.ok();
  }
  void Finish(HttpExchange& exchange) override {
    if (status_.ok()) status_ = finish_(call_);
    AnswerStatus(status_, exchange.response);
  }

 private:
  RestCall call_;
  const int64_t most_;
  const std::function<absl::Status(absl::Span<const uint8_t>)> take_;
  const std::function<absl::Status(RestCall&)> finish_;
  absl::Status status_;
};

}  // namespace

Router::Router(std::vector<Route> routes) : routes_(std::move(routes)) {
  for (const Route& route : routes_) segments_.push_back(Segments(route.path));
}

absl::StatusOr<const Route*> Router::Match(RestCall& call) const {
  const std::string method = call.request.method == "HEAD" ? "GET" : call.request.method;
  const std::vector<std::string> segments = Segments(call.request.path);
  std::set<std::string> allowed;
  for (size_t i = 0; i < routes_.size(); ++i) {
    if (!Fits(segments_[i], segments, call.path)) continue;
    if (routes_[i].method == method) {
      const absl::Status query = CheckQuery(routes_[i], call.request);
      if (!query.ok()) return query;
      return &routes_[i];
    }
    allowed.insert(routes_[i].method);
    if (routes_[i].method == "GET") allowed.insert("HEAD");
  }
  if (allowed.empty()) return absl::NotFoundError("there is nothing at this path");
  const std::string allow = absl::StrJoin(allowed, ", ");
  call.response.headers.Set("Allow", allow);
  return HttpError(405,
                   absl::UnimplementedError(absl::StrCat("method is ", call.request.method, ", expected ", allow)));
}

absl::StatusOr<int64_t> PathNumber(const RestCall& call, const std::string& name, int64_t least, int64_t most) {
  return Number(name, call.path.at(name), least, most);
}

absl::StatusOr<int64_t> QueryNumber(const RestCall& call, const std::string& name, int64_t least, int64_t most,
                                    int64_t otherwise) {
  if (!call.request.HasParam(name)) return otherwise;
  return Number(name, call.request.Param(name), least, most);
}

absl::StatusOr<bool> QueryFlag(const RestCall& call, const std::string& name) {
  if (!call.request.HasParam(name)) return false;
  const std::string text = call.request.Param(name);
  if (text != "true" && text != "false") {
    return FieldError(name, absl::InvalidArgumentError(
                                absl::StrCat(name, " is \"", text.substr(0, kQuoted), "\", expected true or false")));
  }
  return text == "true";
}

absl::Status TakeBody(RestCall& call, int64_t most, std::function<absl::Status(absl::Span<const uint8_t>)> take,
                      std::function<absl::Status(RestCall&)> finish) {
  const std::string encoding = call.request.headers.Get("Content-Encoding");
  const bool encoded = (!encoding.empty() && encoding != "identity") ||
                       absl::StartsWithIgnoreCase(call.request.headers.Get("Content-Type"), "multipart/");
  if (call.request.has_body && encoded) {
    return HttpError(415, absl::InvalidArgumentError("the body is encoded or in several parts, expected it as it is"));
  }
  call.body = std::make_unique<RestBody>(call, most, std::move(take), std::move(finish));
  return absl::OkStatus();
}

void AnswerStatus(const absl::Status& status, HttpResponse& response) {
  if (status.ok()) return;
  response.status = HttpStatusOf(status);
  if (response.status == 401) response.headers.Set("WWW-Authenticate", "Bearer");
  if (response.status == 429 && !response.headers.Has("Retry-After")) response.headers.Set("Retry-After", "1");
  response.SetContent(ProblemJson(status), "application/problem+json");
}

}  // namespace meshwright
