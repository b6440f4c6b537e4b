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
constexpr int64_t kMaxDiscardedBytes = int64_t{4} << 20;

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

absl::Status CheckQuery(const Route& route, const httplib::Request& request) {
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

absl::Status TooLarge(int64_t most) {
  return HttpError(413, absl::InvalidArgumentError(absl::StrCat("the body has more than ", most, " bytes")));
}

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
  call.response.set_header("Allow", allow);
  return HttpError(405,
                   absl::UnimplementedError(absl::StrCat("method is ", call.request.method, ", expected ", allow)));
}

absl::StatusOr<int64_t> PathNumber(const RestCall& call, const std::string& name, int64_t least, int64_t most) {
  return Number(name, call.path.at(name), least, most);
}

absl::StatusOr<int64_t> QueryNumber(const RestCall& call, const std::string& name, int64_t least, int64_t most,
                                    int64_t otherwise) {
  if (!call.request.has_param(name)) return otherwise;
  return Number(name, call.request.get_param_value(name), least, most);
}

absl::StatusOr<bool> QueryFlag(const RestCall& call, const std::string& name) {
  if (!call.request.has_param(name)) return false;
  const std::string text = call.request.get_param_value(name);
  if (text != "true" && text != "false") {
    return FieldError(name, absl::InvalidArgumentError(
                                absl::StrCat(name, " is \"", text.substr(0, kQuoted), "\", expected true or false")));
  }
  return text == "true";
}

absl::Status ReadContent(RestCall& call, int64_t most,
                         const std::function<absl::Status(absl::Span<const uint8_t>)>& take) {
  if (call.content == nullptr) return absl::OkStatus();
  call.content_read = true;
  const std::string encoding = call.request.get_header_value("Content-Encoding");
  // The library would take several parts apart, and would do so without a bound.
  if ((!encoding.empty() && encoding != "identity") || call.request.is_multipart_form_data()) {
    CloseAfterwards(call);
    return HttpError(415, absl::InvalidArgumentError("the body is encoded or in several parts, expected it as it is"));
  }
  const std::string length_text = call.request.get_header_value("Content-Length");
  if (!length_text.empty()) {
    int64_t length = 0;
    const bool digits = length_text.find_first_not_of("0123456789") == std::string::npos;
    if (!digits || !absl::SimpleAtoi(length_text, &length)) {
      CloseAfterwards(call);
      return FieldError("Content-Length",
                        absl::InvalidArgumentError(absl::StrCat("Content-Length is \"", length_text.substr(0, kQuoted),
                                                                "\", expected a whole number")));
    }
    // The library would wait for all of it.
    if (length > most + kMaxDiscardedBytes) {
      CloseAfterwards(call);
      return TooLarge(most);
    }
  }
  absl::Status status;
  int64_t received = 0;
  int64_t discarded = 0;
  const bool whole = (*call.content)([&](const char* bytes, size_t count) {
    received += static_cast<int64_t>(count);
    if (status.ok() && received > most) status = TooLarge(most);
    if (status.ok()) status = take(absl::MakeConstSpan(reinterpret_cast<const uint8_t*>(bytes), count));
    // Whoever is still sending would not hear why: what is left is taken, within limits.
    if (!status.ok()) discarded += static_cast<int64_t>(count);
    return discarded <= kMaxDiscardedBytes;
  });
  if (!whole) CloseAfterwards(call);
  if (!status.ok()) return status;
  if (whole) return absl::OkStatus();
  return absl::InvalidArgumentError("the body ended early");
}

void CloseAfterwards(RestCall& call) {
  // The library closes, and tells the client so, when the request asked for it; the request is not a constant object.
  auto& headers = const_cast<httplib::Headers&>(call.request.headers);
  headers.erase("Connection");
  headers.emplace("Connection", "close");
}

}  // namespace meshwright
