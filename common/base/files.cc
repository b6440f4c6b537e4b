// SPDX-License-Identifier: Apache-2.0
#include "common/base/files.h"

#include <atomic>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <utility>

#include <absl/strings/str_cat.h>
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include "common/base/status_macros.h"

namespace meshwright {
namespace {

constexpr size_t kBufferBytes = size_t{1} << 20;
constexpr char kPartial[] = ".partial-";  // between a file's name and its writer's number

absl::Status SystemError(const std::string& what, const std::string& path, int error) {
  const std::string message = absl::StrCat(path, ": ", what, ": ", std::strerror(error));
  switch (error) {
    case ENOENT:
      return absl::NotFoundError(message);
    case EACCES:
    case EPERM:
    case EROFS:
      return absl::PermissionDeniedError(message);
    case ENOSPC:
    case EDQUOT:
    case EFBIG:
      return absl::ResourceExhaustedError(message);
    default:
      return absl::InternalError(message);
  }
}

absl::Status WriteAll(int descriptor, const uint8_t* data, size_t size, const std::string& path) {
  while (size > 0) {
    const ssize_t written = ::write(descriptor, data, size);
    if (written < 0) {
      if (errno == EINTR) continue;
      return SystemError("cannot write", path, errno);
    }
    data += written;
    size -= static_cast<size_t>(written);
  }
  return absl::OkStatus();
}

// The file that a symbolic link points at, so that writing changes that file and leaves the link; else `path`. Only
// regular files can be replaced: InvalidArgument for folders, devices and pipes.
absl::StatusOr<std::string> ReplaceableFile(const std::string& path) {
  namespace fs = std::filesystem;
  std::error_code error;
  const fs::file_status status = fs::status(path, error);
  if (fs::exists(status) && !fs::is_regular_file(status)) {
    return absl::InvalidArgumentError(absl::StrCat(
        path, ": ", fs::is_directory(status) ? "a folder" : "a device or pipe", "; the name of a file expected"));
  }
  if (!fs::is_symlink(fs::symlink_status(path, error))) return path;
  if (fs::exists(status)) {
    const fs::path target = fs::canonical(path, error);
    return error ? path : target.string();
  }
  // A link to what is not there yet: the file it names is made.
  const fs::path target = fs::read_symlink(path, error);
  return error ? path : (fs::path(path).parent_path() / target).string();
}

}  // namespace

absl::StatusOr<std::string> ReadFile(const std::string& path) {
  const int descriptor = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (descriptor < 0) return SystemError("cannot open", path, errno);
  std::string bytes;
  struct stat info {};
  if (::fstat(descriptor, &info) == 0 && S_ISREG(info.st_mode)) bytes.reserve(static_cast<size_t>(info.st_size));
  char buffer[1 << 16];
  while (true) {
    const ssize_t count = ::read(descriptor, buffer, sizeof(buffer));
    if (count == 0) break;
    if (count < 0) {
      if (errno == EINTR) continue;
      const int error = errno;
      ::close(descriptor);
      return SystemError("cannot read", path, error);
    }
    bytes.append(buffer, static_cast<size_t>(count));
  }
  ::close(descriptor);
  return bytes;
}

AtomicFile::AtomicFile(std::string path, std::string temporary_path, int descriptor)
    : path_(std::move(path)), temporary_path_(std::move(temporary_path)), descriptor_(descriptor) {}

AtomicFile::AtomicFile(AtomicFile&& other) noexcept
    : path_(std::move(other.path_)),
      temporary_path_(std::move(other.temporary_path_)),
      descriptor_(std::exchange(other.descriptor_, -1)),
      buffer_(std::move(other.buffer_)) {}

AtomicFile::~AtomicFile() {
  if (descriptor_ < 0) return;
  ::close(descriptor_);
  ::unlink(temporary_path_.c_str());
}

absl::StatusOr<AtomicFile> AtomicFile::Create(const std::string& asked_path) {
  MW_ASSIGN_OR_RETURN(const std::string path, ReplaceableFile(asked_path));
  while (true) {
    const std::string temporary = PartialPath(path);
    // Processes of several containers may share a folder and have the same number: only one of them gets the name.
    const int descriptor = ::open(temporary.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0644);
    if (descriptor >= 0) return AtomicFile(path, temporary, descriptor);
    if (errno != EEXIST) return SystemError("cannot create", path, errno);
  }
}

absl::Status AtomicFile::Append(absl::Span<const uint8_t> bytes) {
  buffer_.insert(buffer_.end(), bytes.begin(), bytes.end());
  return buffer_.size() >= kBufferBytes ? Flush() : absl::OkStatus();
}

absl::Status AtomicFile::Append(const std::string& bytes) {
  return Append(absl::MakeConstSpan(reinterpret_cast<const uint8_t*>(bytes.data()), bytes.size()));
}

absl::Status AtomicFile::Flush() {
  absl::Status status = WriteAll(descriptor_, buffer_.data(), buffer_.size(), path_);
  buffer_.clear();
  return status;
}

absl::Status AtomicFile::WriteAt(int64_t offset, const std::string& bytes) {
  MW_RETURN_IF_ERROR(Flush());
  if (::lseek(descriptor_, offset, SEEK_SET) < 0) return SystemError("cannot seek", path_, errno);
  MW_RETURN_IF_ERROR(WriteAll(descriptor_, reinterpret_cast<const uint8_t*>(bytes.data()), bytes.size(), path_));
  if (::lseek(descriptor_, 0, SEEK_END) < 0) return SystemError("cannot seek", path_, errno);
  return absl::OkStatus();
}

absl::Status AtomicFile::Commit() {
  MW_RETURN_IF_ERROR(Flush());
  if (::fsync(descriptor_) != 0) return SystemError("cannot sync", path_, errno);
  const int close_result = ::close(std::exchange(descriptor_, -1));
  if (close_result != 0 || ::rename(temporary_path_.c_str(), path_.c_str()) != 0) {
    const int error = errno;
    ::unlink(temporary_path_.c_str());
    return SystemError("cannot rename into place", path_, error);
  }
  // The rename itself must survive a power cut: sync the folder. Not every filesystem can; that is no error.
  const std::string parent = std::filesystem::path(path_).parent_path().string();
  const int folder = ::open(parent.empty() ? "." : parent.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (folder >= 0) {
    ::fsync(folder);
    ::close(folder);
  }
  return absl::OkStatus();
}

absl::Status WriteFileAtomically(const std::string& path, absl::Span<const uint8_t> bytes) {
  MW_ASSIGN_OR_RETURN(AtomicFile file, AtomicFile::Create(path));
  MW_RETURN_IF_ERROR(file.Append(bytes));
  return file.Commit();
}

absl::Status WriteFileAtomically(const std::string& path, const std::string& bytes) {
  return WriteFileAtomically(path, absl::MakeConstSpan(reinterpret_cast<const uint8_t*>(bytes.data()), bytes.size()));
}

std::string PartialPath(const std::string& path) {
  static std::atomic<int> counter{0};
  return absl::StrCat(path, kPartial, ::getpid(), "-", counter.fetch_add(1));
}

void RemovePartialFiles(const std::string& path) {
  namespace fs = std::filesystem;
  const fs::path folder = fs::path(path).parent_path();
  const std::string prefix = fs::path(path).filename().string() + kPartial;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(folder.empty() ? "." : folder, error)) {
    if (entry.path().filename().string().rfind(prefix, 0) == 0) fs::remove(entry.path(), error);
  }
}

void RemoveStalePartialFiles(const std::string& folder, absl::Time oldest) {
  namespace fs = std::filesystem;
  const auto oldest_file = std::chrono::file_clock::from_sys(absl::ToChronoTime(oldest));
  std::error_code error;
  for (auto at = fs::recursive_directory_iterator(folder, fs::directory_options::skip_permission_denied, error);
       !error && at != fs::recursive_directory_iterator(); at.increment(error)) {
    std::error_code of_file;
    if (at->path().filename().string().find(kPartial) == std::string::npos) continue;
    if (!at->is_regular_file(of_file) || at->last_write_time(of_file) > oldest_file || of_file) continue;
    fs::remove(at->path(), of_file);
  }
}

}  // namespace meshwright
