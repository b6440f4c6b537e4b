// SPDX-License-Identifier: Apache-2.0
#include "coordinator/rest/downloads.h"

#include <algorithm>
#include <filesystem>
#include <utility>
#include <vector>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_split.h>
#include <absl/strings/strip.h>

#include "common/base/digest.h"
#include "common/base/relative_path.h"
#include "common/base/status_macros.h"
#include "common/http_server/byte_range.h"
#include "coordinator/rest/problem.h"

namespace meshwright {
namespace {

namespace fs = std::filesystem;

constexpr size_t kKept = 8;

std::string Quoted(const std::string& etag) { return absl::StrCat("\"", etag, "\""); }

}  // namespace

bool HasCopy(const RestCall& call, const std::string& etag) {
  const std::string header = call.request.headers.Get("If-None-Match");
  for (absl::string_view candidate : absl::StrSplit(header, ',')) {
    candidate = absl::StripAsciiWhitespace(candidate);
    absl::ConsumePrefix(&candidate, "W/");
    if (candidate == "*" || candidate == Quoted(etag)) return true;
  }
  return false;
}

absl::Status SendFile(RestCall& call, std::shared_ptr<const OpenedFile> file, const std::string& etag,
                      const std::string& content_type, const std::string& name) {
  call.response.headers.Set("ETag", Quoted(etag));
  call.response.headers.Set("Accept-Ranges", "bytes");
  call.response.headers.Set("Cache-Control", "no-cache");
  if (HasCopy(call, etag)) {
    call.response.status = 304;
    return absl::OkStatus();
  }
  const std::string if_range = call.request.headers.Get("If-Range");
  const std::string header = call.request.headers.Get("Range");
  const ByteRange range = if_range.empty() || if_range == Quoted(etag) ? ParseByteRange(header, file->size_bytes())
                                                                       : ParseByteRange("", file->size_bytes());
  if (range.kind == ByteRange::Kind::kUnsatisfiable) {
    call.response.headers.Set("Content-Range", absl::StrCat("bytes */", file->size_bytes()));
    return FieldError(
        "Range", HttpError(416, absl::OutOfRangeError(absl::StrCat("Range is \"", header.substr(0, 64),
                                                                   "\", expected bytes of ", file->size_bytes()))));
  }
  call.response.status = 200;
  if (range.kind == ByteRange::Kind::kPart) {
    call.response.status = 206;
    call.response.headers.Set("Content-Range", absl::StrCat("bytes ", range.first, "-", range.first + range.count - 1,
                                                            "/", file->size_bytes()));
  }
  call.response.headers.Set("Content-Disposition", absl::StrCat("attachment; filename=\"", name, "\""));
  if (range.count == 0) {
    call.response.SetContent("", content_type);
    return absl::OkStatus();
  }
  call.response.SetPieces(
      range.count, content_type,
      [file = std::move(file), first = range.first](int64_t offset, size_t most) -> absl::StatusOr<std::string> {
        std::string piece(most, '\0');
        MW_ASSIGN_OR_RETURN(const size_t got, file->Read(first + offset, piece.data(), piece.size()));
        piece.resize(got);
        return piece;
      });
  return absl::OkStatus();
}

absl::Status SendImmutable(RestCall& call, const std::string& etag, const std::string& content_type,
                           const std::function<absl::StatusOr<std::string>()>& make) {
  if (HasCopy(call, etag)) {
    call.response.status = 304;
  } else {
    MW_ASSIGN_OR_RETURN(const std::string bytes, make());
    call.response.status = 200;
    call.response.SetContent(bytes, content_type);
  }
  call.response.headers.Set("ETag", Quoted(etag));
  call.response.headers.Set("Cache-Control", "private, max-age=31536000, immutable");
  return absl::OkStatus();
}

absl::StatusOr<std::unique_ptr<DerivedFiles>> DerivedFiles::Open(const std::string& folder) {
  std::error_code error;
  fs::remove_all(folder, error);
  fs::create_directories(folder, error);
  if (error) {
    return absl::PermissionDeniedError(absl::StrCat(folder, ": cannot make the folder: ", error.message()));
  }
  return std::unique_ptr<DerivedFiles>(new DerivedFiles(folder));
}

absl::StatusOr<std::shared_ptr<const OpenedFile>> DerivedFiles::Get(
    const std::string& key, const std::function<absl::Status(const std::string&)>& make) {
  MW_ASSIGN_OR_RETURN(const std::string path, Make(key, make));
  return OpenedFile::Open(path);
}

absl::StatusOr<std::shared_ptr<const OpenedFile>> DerivedFiles::GetFrom(
    const std::string& key, const std::string& name, const std::function<absl::Status(const std::string&)>& make) {
  MW_RETURN_IF_ERROR(ValidateRelativePath(name));
  MW_ASSIGN_OR_RETURN(const std::string folder, Make(key, make));
  const std::string path = absl::StrCat(folder, "/", name);
  std::error_code error;
  if (!fs::is_regular_file(path, error)) return absl::NotFoundError("there is nothing at this path");
  return OpenedFile::Open(path);
}

absl::StatusOr<std::string> DerivedFiles::Make(const std::string& key,
                                               const std::function<absl::Status(const std::string&)>& make) {
  const std::string path = absl::StrCat(folder_, "/", Sha256Hex(key));
  if (Use(path)) return path;
  const MutexLock lock(making_);
  if (Use(path)) return path;  // somebody else has made it meanwhile
  const absl::Status made = make(path);
  if (made.ok()) {
    Add(path);
    return path;
  }
  std::error_code error;
  fs::remove_all(path, error);
  return made;
}

bool DerivedFiles::Use(const std::string& path) {
  const MutexLock lock(mutex_);
  const auto found = last_use_.find(path);
  if (found == last_use_.end()) return false;
  found->second = ++uses_;
  return true;
}

void DerivedFiles::Add(const std::string& path) {
  const MutexLock lock(mutex_);
  while (last_use_.size() >= kKept) {
    const auto oldest = std::min_element(last_use_.begin(), last_use_.end(),
                                         [](const auto& a, const auto& b) { return a.second < b.second; });
    std::error_code error;
    fs::remove_all(oldest->first, error);
    last_use_.erase(oldest);
  }
  last_use_[path] = ++uses_;
}

}  // namespace meshwright
