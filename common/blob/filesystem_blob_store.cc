#include "common/blob/filesystem_blob_store.h"

#include <filesystem>
#include <system_error>
#include <utility>

#include <absl/strings/str_cat.h>
#include <fcntl.h>
#include <unistd.h>

#include "common/base/digest.h"
#include "common/base/files.h"
#include "common/base/status_macros.h"

namespace meshwright {
namespace {

namespace fs = std::filesystem;

absl::Status SystemError(const std::string& what, const std::string& path, const std::error_code& error) {
  const std::string message = absl::StrCat(path, ": ", what, ": ", error.message());
  if (error == std::errc::no_space_on_device) return absl::ResourceExhaustedError(message);
  if (error == std::errc::permission_denied || error == std::errc::operation_not_permitted ||
      error == std::errc::read_only_file_system) {
    return absl::PermissionDeniedError(message);
  }
  return absl::InternalError(message);
}

// A new folder must survive a power cut as well as the files in it. Not every filesystem can; that is no error.
void SyncFolder(const std::string& path) {
  const int folder = ::open(path.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (folder < 0) return;
  ::fsync(folder);
  ::close(folder);
}

}  // namespace

FilesystemBlobStore::FilesystemBlobStore(std::string root) : root_(std::move(root)) {}

absl::StatusOr<std::unique_ptr<FilesystemBlobStore>> FilesystemBlobStore::Open(const std::string& root) {
  std::error_code error;
  fs::create_directories(root, error);
  if (error) return SystemError("cannot create the folder of the blob store", root, error);
  return std::unique_ptr<FilesystemBlobStore>(new FilesystemBlobStore(root));
}

std::string FilesystemBlobStore::PathOf(const std::string& digest) const {
  return absl::StrCat(root_, "/", digest.substr(0, 2), "/", digest);
}

absl::StatusOr<std::string> FilesystemBlobStore::Put(const std::string& bytes) {
  const std::string digest = Sha256Hex(bytes);
  const std::string path = PathOf(digest);
  const std::string shard = fs::path(path).parent_path().string();
  std::error_code error;
  const bool created = fs::create_directory(shard, error);
  if (error) return SystemError("cannot create a folder of the blob store", shard, error);
  if (created) SyncFolder(root_);
  // Also when the blob is there already: whether it is sound and synced is as dear to find out as to write it.
  MW_RETURN_IF_ERROR(WriteFileAtomically(path, bytes));
  return digest;
}

absl::StatusOr<std::string> FilesystemBlobStore::Get(const std::string& digest) {
  MW_RETURN_IF_ERROR(ValidateDigest(digest));
  const std::string path = PathOf(digest);
  MW_ASSIGN_OR_RETURN(std::string bytes, ReadFile(path));
  const std::string actual = Sha256Hex(bytes);
  if (actual != digest) {
    return absl::DataLossError(absl::StrCat(path, ": blob has digest ", actual, ", expected ", digest));
  }
  return bytes;
}

absl::StatusOr<bool> FilesystemBlobStore::Has(const std::string& digest) {
  MW_RETURN_IF_ERROR(ValidateDigest(digest));
  const std::string path = PathOf(digest);
  std::error_code error;
  const bool exists = fs::exists(path, error);
  if (error) return SystemError("cannot look for the blob", path, error);
  return exists;
}

absl::Status FilesystemBlobStore::Delete(const std::string& digest) {
  MW_RETURN_IF_ERROR(ValidateDigest(digest));
  const std::string path = PathOf(digest);
  std::error_code error;
  fs::remove(path, error);
  if (error) return SystemError("cannot delete the blob", path, error);
  return absl::OkStatus();
}

}  // namespace meshwright
