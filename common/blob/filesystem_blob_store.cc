// SPDX-License-Identifier: Apache-2.0
#include "common/blob/filesystem_blob_store.h"

#include <cerrno>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <system_error>
#include <utility>
#include <vector>

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

// Reads a file piece by piece; with `copy`, writes the pieces there.
absl::StatusOr<std::string> DigestOfFile(const std::string& path, AtomicFile* copy) {
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(std::fopen(path.c_str(), "rb"), std::fclose);
  if (file == nullptr) {
    if (errno == ENOENT) return absl::NotFoundError(absl::StrCat(path, ": no such file"));
    return SystemError("cannot be read", path, std::error_code(errno, std::generic_category()));
  }
  std::vector<uint8_t> buffer(size_t{1} << 20);
  Sha256Stream digest;
  while (const size_t count = std::fread(buffer.data(), 1, buffer.size(), file.get())) {
    const auto piece = absl::MakeConstSpan(buffer.data(), count);
    digest.Update(piece);
    if (copy != nullptr) MW_RETURN_IF_ERROR(copy->Append(piece));
  }
  if (std::ferror(file.get()) != 0) {
    return SystemError("cannot be read", path, std::error_code(errno, std::generic_category()));
  }
  return digest.HexDigest();
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

absl::Status FilesystemBlobStore::MakeFolderOf(const std::string& path) {
  const std::string shard = fs::path(path).parent_path().string();
  std::error_code error;
  const bool created = fs::create_directories(shard, error);  // the root too, where somebody has deleted it
  if (error) return SystemError("cannot create a folder of the blob store", shard, error);
  if (created) SyncFolder(root_);
  return absl::OkStatus();
}

absl::StatusOr<std::string> FilesystemBlobStore::Put(const std::string& bytes) {
  const std::string digest = Sha256Hex(bytes);
  const std::string path = PathOf(digest);
  MW_RETURN_IF_ERROR(MakeFolderOf(path));
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

absl::StatusOr<std::string> FilesystemBlobStore::PutFile(const std::string& path) {
  MW_ASSIGN_OR_RETURN(const std::string digest, DigestOfFile(path, nullptr));
  const std::string target = PathOf(digest);
  MW_RETURN_IF_ERROR(MakeFolderOf(target));
  MW_ASSIGN_OR_RETURN(AtomicFile file, AtomicFile::Create(target));
  MW_ASSIGN_OR_RETURN(const std::string copied, DigestOfFile(path, &file));
  if (copied != digest) return absl::AbortedError(absl::StrCat(path, ": it changed while it was copied"));
  MW_RETURN_IF_ERROR(file.Commit());
  return digest;
}

absl::Status FilesystemBlobStore::GetFile(const std::string& digest, const std::string& path) {
  MW_RETURN_IF_ERROR(ValidateDigest(digest));
  const std::string source = PathOf(digest);
  MW_ASSIGN_OR_RETURN(AtomicFile file, AtomicFile::Create(path));
  MW_ASSIGN_OR_RETURN(const std::string actual, DigestOfFile(source, &file));
  if (actual != digest) {
    return absl::DataLossError(absl::StrCat(source, ": blob has digest ", actual, ", expected ", digest));
  }
  return file.Commit();
}

absl::Status FilesystemBlobStore::Adopt(const std::string& path, const std::string& digest) {
  MW_RETURN_IF_ERROR(ValidateDigest(digest));
  const std::string target = PathOf(digest);
  MW_RETURN_IF_ERROR(MakeFolderOf(target));
  std::error_code error;
  fs::rename(path, target, error);
  if (error == std::errc::cross_device_link) return BlobStore::Adopt(path, digest);
  if (error) return SystemError("cannot move the blob into place", target, error);
  SyncFolder(fs::path(target).parent_path().string());
  return absl::OkStatus();
}

std::string FilesystemBlobStore::staging_folder() const { return absl::StrCat(root_, "/staging"); }

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
