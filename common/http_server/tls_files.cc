// SPDX-License-Identifier: Apache-2.0
#include "common/http_server/tls_files.h"

#include <utility>

#include <absl/strings/str_cat.h>
#include <openssl/ssl.h>
#include <sys/stat.h>

#include "common/base/status_macros.h"

namespace meshwright {
namespace {

absl::Status FileError(const std::string& path, const char* expected, const boost::system::error_code& error) {
  return absl::InvalidArgumentError(absl::StrCat(path, ": expected ", expected, ": ", error.message()));
}

}  // namespace

TlsFiles::TlsFiles(std::string certificate_file, std::string key_file, std::function<void(const std::string&)> warn)
    : certificate_file_(std::move(certificate_file)), key_file_(std::move(key_file)), warn_(std::move(warn)) {}

absl::StatusOr<std::unique_ptr<TlsFiles>> TlsFiles::Open(const std::string& certificate_file,
                                                         const std::string& key_file,
                                                         std::function<void(const std::string&)> warn) {
  auto files = std::unique_ptr<TlsFiles>(new TlsFiles(certificate_file, key_file, std::move(warn)));
  files->stamp_ = files->StampNow();
  MW_ASSIGN_OR_RETURN(files->context_, files->Load());
  return files;
}

absl::StatusOr<std::shared_ptr<TlsFiles::Context>> TlsFiles::Load() const {
  auto context = std::make_shared<Context>(Context::tls_server);
  context->set_options(Context::default_workarounds | Context::no_tlsv1 | Context::no_tlsv1_1 |
                       SSL_OP_NO_RENEGOTIATION);
  boost::system::error_code error;
  context->use_certificate_chain_file(certificate_file_, error);
  if (error) return FileError(certificate_file_, "a certificate in PEM", error);
  context->use_private_key_file(key_file_, Context::pem, error);
  if (error) return FileError(key_file_, "the certificate's key in PEM", error);
  if (::SSL_CTX_check_private_key(context->native_handle()) != 1) {
    return absl::InvalidArgumentError(absl::StrCat(key_file_, ": is not the key of ", certificate_file_));
  }
  return context;
}

TlsFiles::Stamp TlsFiles::StampNow() const {
  Stamp stamp = {};
  size_t at = 0;
  for (const std::string& path : {certificate_file_, key_file_}) {
    struct stat status = {};
    ::stat(path.c_str(), &status);
    for (const int64_t value : {static_cast<int64_t>(status.st_dev), static_cast<int64_t>(status.st_ino),
                                static_cast<int64_t>(status.st_size), static_cast<int64_t>(status.st_mtim.tv_sec),
                                static_cast<int64_t>(status.st_mtim.tv_nsec)}) {
      stamp[at++] = value;
    }
  }
  return stamp;
}

std::shared_ptr<TlsFiles::Context> TlsFiles::Current() {
  const Stamp stamp = StampNow();
  if (stamp == stamp_) return context_;
  stamp_ = stamp;
  auto loaded = Load();
  if (loaded.ok()) {
    context_ = *std::move(loaded);
  } else {
    warn_(absl::StrCat("the certificate of before stays in use: ", std::string(loaded.status().message())));
  }
  return context_;
}

}  // namespace meshwright
