// SPDX-License-Identifier: Apache-2.0
#include "common/http_server/http_message.h"

#include <algorithm>

#include <absl/strings/ascii.h>
#include <absl/strings/match.h>
#include <absl/strings/str_split.h>

namespace meshwright {
namespace {

int HexDigit(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  return -1;
}

// What is no pair of digits behind a percent sign stays as it is.
std::string PercentDecode(const std::string& text, bool plus_is_blank) {
  std::string decoded;
  decoded.reserve(text.size());
  for (size_t i = 0; i < text.size(); ++i) {
    const int high = text[i] == '%' && i + 2 < text.size() ? HexDigit(text[i + 1]) : -1;
    const int low = high >= 0 ? HexDigit(text[i + 2]) : -1;
    if (low >= 0) {
      decoded.push_back(static_cast<char>(high * 16 + low));
      i += 2;
    } else {
      decoded.push_back(plus_is_blank && text[i] == '+' ? ' ' : text[i]);
    }
  }
  return decoded;
}

}  // namespace

void HttpHeaders::Add(std::string name, std::string value) { fields_.emplace_back(std::move(name), std::move(value)); }

void HttpHeaders::Set(std::string name, std::string value) {
  fields_.erase(std::remove_if(fields_.begin(), fields_.end(),
                               [&](const auto& field) { return absl::EqualsIgnoreCase(field.first, name); }),
                fields_.end());
  Add(std::move(name), std::move(value));
}

size_t HttpHeaders::Count(const std::string& name) const {
  return static_cast<size_t>(std::count_if(
      fields_.begin(), fields_.end(), [&](const auto& field) { return absl::EqualsIgnoreCase(field.first, name); }));
}

std::string HttpHeaders::Get(const std::string& name) const {
  for (const auto& [field, value] : fields_) {
    if (absl::EqualsIgnoreCase(field, name)) return value;
  }
  return "";
}

std::string HttpRequest::Param(const std::string& name) const {
  const auto found = params.find(name);
  return found == params.end() ? "" : found->second;
}

bool ParseTarget(const std::string& target, HttpRequest& request) {
  std::string text = target;
  for (const char* scheme : {"http://", "https://"}) {
    if (!absl::StartsWithIgnoreCase(text, scheme)) continue;
    const size_t path = text.find_first_of("/?", std::string(scheme).size());
    text = path == std::string::npos ? "/" : text.substr(path);
    if (text[0] == '?') text.insert(0, 1, '/');
    break;
  }
  if (text.empty() || text[0] != '/') return false;
  text.resize(std::min(text.size(), text.find('#')));
  const size_t question = text.find('?');
  request.path = PercentDecode(text.substr(0, question), false);
  request.params.clear();
  if (question == std::string::npos) return true;
  const std::vector<std::string> pairs = absl::StrSplit(text.substr(question + 1), '&', absl::SkipEmpty());
  for (const std::string& pair : pairs) {
    const size_t equals = pair.find('=');
    const std::string value = equals == std::string::npos ? "" : pair.substr(equals + 1);
    request.params.emplace(PercentDecode(pair.substr(0, equals), true), PercentDecode(value, true));
  }
  return true;
}

void HttpResponse::SetContent(std::string bytes, const std::string& content_type) {
  content = std::move(bytes);
  pieces = nullptr;
  events = nullptr;
  headers.Set("Content-Type", content_type);
}

void HttpResponse::SetPieces(int64_t size_bytes, const std::string& content_type, Pieces read) {
  SetContent("", content_type);
  piece_bytes = size_bytes;
  pieces = std::move(read);
}

void HttpResponse::SetEvents(const std::string& content_type, std::unique_ptr<HttpEventSource> source) {
  SetContent("", content_type);
  events = std::move(source);
}

}  // namespace meshwright
