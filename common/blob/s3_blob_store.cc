// SPDX-License-Identifier: Apache-2.0
#include "common/blob/s3_blob_store.h"

#include <algorithm>
#include <cerrno>
#include <filesystem>
#include <system_error>
#include <utility>

#include <absl/strings/ascii.h>
#include <absl/strings/escaping.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include "common/base/digest.h"
#include "common/base/status_macros.h"

namespace meshwright {
namespace {

// A file's bytes where the system keeps them anyway.
class MappedFile {
 public:
  static absl::StatusOr<MappedFile> Open(const std::string& path) {
    const int descriptor = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
    if (descriptor < 0) return absl::ErrnoToStatus(errno, absl::StrCat(path, ": cannot open"));
    struct stat info {};
    const bool known = ::fstat(descriptor, &info) == 0;
    const auto size = static_cast<size_t>(info.st_size);
    void* bytes = nullptr;
    if (known && size > 0) bytes = ::mmap(nullptr, size, PROT_READ, MAP_PRIVATE, descriptor, 0);
    const int error = errno;
    ::close(descriptor);
    if (!known || bytes == MAP_FAILED) return absl::ErrnoToStatus(error, absl::StrCat(path, ": cannot read"));
    return MappedFile(static_cast<const uint8_t*>(bytes), size);
  }
  MappedFile(MappedFile&& other) noexcept : bytes_(std::exchange(other.bytes_, {})) {}
  MappedFile& operator=(MappedFile&&) = delete;
  ~MappedFile() {
    if (!bytes_.empty()) ::munmap(const_cast<uint8_t*>(bytes_.data()), bytes_.size());
  }
  absl::Span<const uint8_t> bytes() const { return bytes_; }

 private:
  MappedFile(const uint8_t* bytes, size_t size) : bytes_(bytes, size) {}
  absl::Span<const uint8_t> bytes_;
};

constexpr int64_t kMostParts = 10'000;  // a limit of S3

std::string PercentEncoded(const std::string& text) {
  std::string encoded;
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (absl::ascii_isalnum(byte) || c == '-' || c == '_' || c == '.' || c == '~') {
      encoded += c;
    } else {
      absl::StrAppendFormat(&encoded, "%%%02X", byte);
    }
  }
  return encoded;
}

}  // namespace

absl::StatusOr<std::unique_ptr<S3BlobStore>> S3BlobStore::Open(const S3Options& options) {
  MW_RETURN_IF_ERROR(options.Validate());
  std::unique_ptr<S3BlobStore> store(new S3BlobStore(options));
  const absl::Status found = store->client_.Send({.method = "HEAD", .key = ""}).status();
  if (absl::IsNotFound(found)) {
    return absl::FailedPreconditionError(absl::StrCat(store->client_.UrlOf(""), ": there is no such bucket"));
  }
  MW_RETURN_IF_ERROR(found);
  return store;
}

std::string S3BlobStore::KeyOf(const std::string& digest) { return absl::StrCat(digest.substr(0, 2), "/", digest); }

absl::StatusOr<std::string> S3BlobStore::Put(const std::string& bytes) {
  std::string digest = Sha256Hex(bytes);
  MW_RETURN_IF_ERROR(
      PutObject(digest, absl::MakeConstSpan(reinterpret_cast<const uint8_t*>(bytes.data()), bytes.size())));
  return digest;
}

absl::Status S3BlobStore::Adopt(const std::string& path, const std::string& digest) {
  MW_RETURN_IF_ERROR(ValidateDigest(digest));
  MW_ASSIGN_OR_RETURN(const MappedFile file, MappedFile::Open(path));
  MW_RETURN_IF_ERROR(PutObject(digest, file.bytes()));
  std::error_code error;
  std::filesystem::remove(path, error);
  return absl::OkStatus();
}

absl::Status S3BlobStore::PutObject(const std::string& digest, absl::Span<const uint8_t> bytes) {
  const auto size = static_cast<int64_t>(bytes.size());
  // Also when the object is there already: whether it is sound is as dear to find out as to write it.
  if (size > client_.options().part_bytes) return PutInParts(KeyOf(digest), bytes);
  return client_
      .Send({.method = "PUT",
             .key = KeyOf(digest),
             .body = reinterpret_cast<const char*>(bytes.data()),
             .body_bytes = size,
             .body_sha256 = digest})
      .status();
}

absl::Status S3BlobStore::PutInParts(const std::string& key, absl::Span<const uint8_t> bytes) {
  MW_ASSIGN_OR_RETURN(const S3Response begun, client_.Send({.method = "POST", .key = key, .query = "uploads="}));
  const std::string upload_id = PercentEncoded(XmlText(begun.body, "UploadId"));
  if (upload_id.empty()) return absl::InternalError(absl::StrCat(client_.UrlOf(key), ": no UploadId was given"));
  const std::string query = absl::StrCat("uploadId=", upload_id);
  absl::Status status;
  const absl::StatusOr<std::string> parts = UploadParts(key, upload_id, bytes);
  if (parts.ok()) {
    const absl::StatusOr<S3Response> completed = client_.Send({.method = "POST",
                                                               .key = key,
                                                               .query = query,
                                                               .body = parts->data(),
                                                               .body_bytes = static_cast<int64_t>(parts->size()),
                                                               .body_sha256 = Sha256Hex(*parts)});
    status = completed.status();
    // S3 may begin with "200" and then fail. And where an answer was lost, the upload is finished and unknown now.
    if (completed.ok() && completed->body.find("<Error>") != std::string::npos) {
      status = absl::UnavailableError(absl::StrCat(client_.UrlOf(key), ": ", XmlText(completed->body, "Code"), ": ",
                                                   XmlText(completed->body, "Message")));
    } else if (absl::IsNotFound(status)) {
      status = client_.Send({.method = "HEAD", .key = key}).status();
    }
  } else {
    status = parts.status();
  }
  // Parts that nobody completes would be stored, and paid for, forever.
  if (!status.ok()) client_.Send({.method = "DELETE", .key = key, .query = query}).IgnoreError();
  return status;
}

absl::StatusOr<std::string> S3BlobStore::UploadParts(const std::string& key, const std::string& upload_id,
                                                     absl::Span<const uint8_t> bytes) {
  const auto size = static_cast<int64_t>(bytes.size());
  const int64_t part_bytes = std::max(client_.options().part_bytes, (size + kMostParts - 1) / kMostParts);
  std::string list = "<CompleteMultipartUpload>";
  for (int64_t begin = 0, number = 1; begin < size; begin += part_bytes, ++number) {
    const int64_t length = std::min(part_bytes, size - begin);
    const auto part = bytes.subspan(static_cast<size_t>(begin), static_cast<size_t>(length));
    MW_ASSIGN_OR_RETURN(const S3Response response,
                        client_.Send({.method = "PUT",
                                      .key = key,
                                      .query = absl::StrCat("partNumber=", number, "&uploadId=", upload_id),
                                      .body = reinterpret_cast<const char*>(part.data()),
                                      .body_bytes = length,
                                      .body_sha256 = Sha256Hex(part)}));
    absl::StrAppend(&list, "<Part><PartNumber>", number, "</PartNumber><ETag>", response.etag, "</ETag></Part>");
  }
  return absl::StrCat(list, "</CompleteMultipartUpload>");
}

absl::StatusOr<std::string> S3BlobStore::Get(const std::string& digest) {
  MW_RETURN_IF_ERROR(ValidateDigest(digest));
  const std::string key = KeyOf(digest);
  MW_ASSIGN_OR_RETURN(S3Response response, client_.Send({.method = "GET", .key = key}));
  const std::string actual = Sha256Hex(response.body);
  if (actual != digest) {
    return absl::DataLossError(absl::StrCat(client_.UrlOf(key), ": blob has digest ", actual, ", expected ", digest));
  }
  return std::move(response.body);
}

absl::StatusOr<bool> S3BlobStore::Has(const std::string& digest) {
  MW_RETURN_IF_ERROR(ValidateDigest(digest));
  const absl::Status status = client_.Send({.method = "HEAD", .key = KeyOf(digest)}).status();
  if (absl::IsNotFound(status)) return false;
  MW_RETURN_IF_ERROR(status);
  return true;
}

absl::Status S3BlobStore::Delete(const std::string& digest) {
  MW_RETURN_IF_ERROR(ValidateDigest(digest));
  const absl::Status status = client_.Send({.method = "DELETE", .key = KeyOf(digest)}).status();
  return absl::IsNotFound(status) ? absl::OkStatus() : status;
}

}  // namespace meshwright
