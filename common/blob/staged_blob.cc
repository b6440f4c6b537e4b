// SPDX-License-Identifier: Apache-2.0
#include "common/blob/staged_blob.h"

#include <algorithm>
#include <cerrno>
#include <filesystem>
#include <random>
#include <system_error>
#include <utility>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include "common/base/status_macros.h"

namespace meshwright {
namespace {

namespace fs = std::filesystem;

constexpr int64_t kReadBytes = int64_t{1} << 20;

absl::Status SystemError(const char* what, int error) {
  const std::string message = absl::StrCat(what, ": ", std::generic_category().message(error));
  if (error == ENOSPC || error == EDQUOT || error == EFBIG) return absl::ResourceExhaustedError(message);
  return absl::InternalError(message);
}

absl::StatusOr<std::string> ReadAt(int descriptor, int64_t offset, size_t count) {
  std::string bytes(count, '\0');
  size_t done = 0;
  while (done < count) {
    const ssize_t got = ::pread(descriptor, &bytes[done], count - done, offset + static_cast<int64_t>(done));
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) return SystemError("staged bytes cannot be read", errno);
    if (got == 0) break;
    done += static_cast<size_t>(got);
  }
  bytes.resize(done);
  return bytes;
}

}  // namespace

absl::StatusOr<std::string> StagedBlob::NewPath(const std::string& folder) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) return absl::PermissionDeniedError(absl::StrCat(folder, ": cannot make the folder: ", error.message()));
  std::random_device random;
  std::string name;
  for (int i = 0; i < 4; ++i) absl::StrAppendFormat(&name, "%08x", random());
  return absl::StrCat(folder, "/", name);
}

absl::StatusOr<std::unique_ptr<StagedBlob>> StagedBlob::Open(const std::string& path, int64_t kept_bytes,
                                                             Sha256Stream kept) {
  const int descriptor = ::open(path.c_str(), O_RDWR | O_CLOEXEC | (kept_bytes == 0 ? O_CREAT : 0), 0644);
  if (descriptor < 0 && errno == ENOENT && kept_bytes > 0) return absl::DataLossError("staged bytes are gone");
  if (descriptor < 0) return SystemError("bytes cannot be staged", errno);
  auto staged = std::unique_ptr<StagedBlob>(new StagedBlob(path, descriptor, kept_bytes, std::move(kept)));
  struct stat info {};
  if (::fstat(descriptor, &info) != 0 || info.st_size < kept_bytes) {
    return absl::DataLossError(absl::StrCat("of ", kept_bytes, " staged bytes ", info.st_size, " are there"));
  }
  if (::ftruncate(descriptor, kept_bytes) != 0) return SystemError("bytes cannot be staged", errno);
  return staged;
}

absl::StatusOr<Sha256Stream> StagedBlob::DigestOf(const std::string& path, int64_t bytes) {
  Sha256Stream digest;
  const int descriptor = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (descriptor < 0) return absl::DataLossError("staged bytes are gone");
  absl::Status status;
  for (int64_t offset = 0; status.ok() && offset < bytes;) {
    const auto piece = ReadAt(descriptor, offset, static_cast<size_t>(std::min(kReadBytes, bytes - offset)));
    status = piece.status();
    if (piece.ok() && piece->empty()) status = absl::DataLossError("staged bytes are gone");
    if (!status.ok()) break;
    digest.Update(absl::MakeConstSpan(reinterpret_cast<const uint8_t*>(piece->data()), piece->size()));
    offset += static_cast<int64_t>(piece->size());
  }
  ::close(descriptor);
  MW_RETURN_IF_ERROR(status);
  return digest;
}

StagedBlob::StagedBlob(std::string path, int descriptor, int64_t size_bytes, Sha256Stream digest)
    : path_(std::move(path)), descriptor_(descriptor), size_bytes_(size_bytes), digest_(std::move(digest)) {}

StagedBlob::~StagedBlob() { ::close(descriptor_); }

absl::Status StagedBlob::Append(absl::Span<const uint8_t> bytes) {
  digest_.Update(bytes);
  while (!bytes.empty()) {
    const ssize_t written = ::pwrite(descriptor_, bytes.data(), bytes.size(), size_bytes_);
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) return SystemError("bytes cannot be staged", errno);
    bytes.remove_prefix(static_cast<size_t>(written));
    size_bytes_ += written;
  }
  return absl::OkStatus();
}

absl::StatusOr<std::string> StagedBlob::Read(int64_t offset, size_t count) const {
  return ReadAt(descriptor_, offset, count);
}

absl::Status StagedBlob::Sync() {
  return ::fdatasync(descriptor_) == 0 ? absl::OkStatus() : SystemError("bytes cannot be staged", errno);
}

}  // namespace meshwright
