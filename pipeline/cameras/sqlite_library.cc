// SPDX-License-Identifier: Apache-2.0
#include "pipeline/cameras/sqlite_library.h"

#include <absl/strings/str_cat.h>
#include <dlfcn.h>

#include "common/base/check.h"

namespace meshwright {
namespace {

constexpr char kLibrary[] = "libsqlite3.so.0";

struct Loaded {
  SqliteFunctions functions;
  absl::Status status;
};

template <typename Function>
bool Find(void* library, const char* name, Function& function) {
  function = reinterpret_cast<Function>(::dlsym(library, name));
  return function != nullptr;
}

Loaded Load() {
  Loaded loaded;
  // Stays until the process ends.
  void* const library = ::dlopen(kLibrary, RTLD_NOW | RTLD_LOCAL);
  if (library == nullptr) {
    loaded.status = absl::NotFoundError(
        absl::StrCat(kLibrary, ": not found, COLMAP's database is read with it (apt-get install libsqlite3-0)"));
    return loaded;
  }
  SqliteFunctions& functions = loaded.functions;
  const bool complete =
      Find(library, "sqlite3_bind_blob", functions.bind_blob) &&
      Find(library, "sqlite3_bind_int64", functions.bind_int64) &&
      Find(library, "sqlite3_bind_text", functions.bind_text) &&
      Find(library, "sqlite3_busy_timeout", functions.busy_timeout) &&
      Find(library, "sqlite3_close", functions.close) && Find(library, "sqlite3_column_blob", functions.column_blob) &&
      Find(library, "sqlite3_column_bytes", functions.column_bytes) &&
      Find(library, "sqlite3_column_int64", functions.column_int64) &&
      Find(library, "sqlite3_column_text", functions.column_text) &&
      Find(library, "sqlite3_errmsg", functions.errmsg) && Find(library, "sqlite3_exec", functions.exec) &&
      Find(library, "sqlite3_finalize", functions.finalize) && Find(library, "sqlite3_open_v2", functions.open_v2) &&
      Find(library, "sqlite3_prepare_v2", functions.prepare_v2) && Find(library, "sqlite3_step", functions.step);
  if (!complete) loaded.status = absl::NotFoundError(absl::StrCat(kLibrary, ": too old, expected 3.5 or later"));
  return loaded;
}

const Loaded& TheOne() {
  static const Loaded loaded = Load();
  return loaded;
}

}  // namespace

absl::Status LoadSqlite() { return TheOne().status; }

const SqliteFunctions& Sqlite() {
  MW_CHECK(TheOne().status.ok());
  return TheOne().functions;
}

}  // namespace meshwright
