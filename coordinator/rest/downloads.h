// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "common/base/mutex.h"
#include "common/base/opened_file.h"
#include "coordinator/rest/router.h"

namespace meshwright {

// Answers with the file or the range of it that was asked for: 200, 206, 304 or 416. `etag` without its quotation
// marks. `name` is what a browser saves it as.
absl::Status SendFile(RestCall& call, std::shared_ptr<const OpenedFile> file, const std::string& etag,
                      const std::string& content_type, const std::string& name);

// Answers with bytes that never change under this path, or with 304.
absl::Status SendImmutable(RestCall& call, const std::string& etag, const std::string& content_type,
                           const std::function<absl::StatusOr<std::string>()>& make);

// Whether the client's copy is good.
bool HasCopy(const RestCall& call, const std::string& etag);

// Files, and folders of files, that are made from others when they are asked for, one at a time, so that memory stays
// bounded; what is there already is not waited for. The last few are kept. Thread-safe.
class DerivedFiles {
 public:
  // Makes the folder, or empties it.
  static absl::StatusOr<std::unique_ptr<DerivedFiles>> Open(const std::string& folder);

  // The file of this key, which `make` writes to a path when it is not there. The same key means the same bytes.
  absl::StatusOr<std::shared_ptr<const OpenedFile>> Get(const std::string& key,
                                                        const std::function<absl::Status(const std::string&)>& make);

  // The file `name` in the folder of this key, which `make` fills when it is not there. NotFound where there is no
  // such file; `name` leads nowhere outside of the folder.
  absl::StatusOr<std::shared_ptr<const OpenedFile>> GetFrom(
      const std::string& key, const std::string& name, const std::function<absl::Status(const std::string&)>& make);

 private:
  explicit DerivedFiles(std::string folder) : folder_(std::move(folder)) {}
  // The path at which what this key stands for lies, made if it was not there.
  absl::StatusOr<std::string> Make(const std::string& key, const std::function<absl::Status(const std::string&)>& make);
  // Whether it is there; it is used now.
  bool Use(const std::string& path);
  void Add(const std::string& path);

  const std::string folder_;
  Mutex making_;  // held while one is made, and taken before mutex_
  Mutex mutex_;
  int64_t uses_ ABSL_GUARDED_BY(mutex_) = 0;
  std::map<std::string, int64_t> last_use_ ABSL_GUARDED_BY(mutex_);  // path -> the last one of uses_
};

}  // namespace meshwright
