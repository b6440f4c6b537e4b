// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <absl/status/status.h>
#include <sqlite3.h>

namespace meshwright {

// What of SQLite COLMAP's database is read and written with. The library is the one that COLMAP brings, loaded when a
// database is opened: a worker, which has this room for photographs that come alone, links no database.
struct SqliteFunctions {
  decltype(&sqlite3_bind_blob) bind_blob = nullptr;
  decltype(&sqlite3_bind_int64) bind_int64 = nullptr;
  decltype(&sqlite3_bind_text) bind_text = nullptr;
  decltype(&sqlite3_busy_timeout) busy_timeout = nullptr;
  decltype(&sqlite3_close) close = nullptr;
  decltype(&sqlite3_column_blob) column_blob = nullptr;
  decltype(&sqlite3_column_bytes) column_bytes = nullptr;
  decltype(&sqlite3_column_int64) column_int64 = nullptr;
  decltype(&sqlite3_column_text) column_text = nullptr;
  decltype(&sqlite3_errmsg) errmsg = nullptr;
  decltype(&sqlite3_exec) exec = nullptr;
  decltype(&sqlite3_finalize) finalize = nullptr;
  decltype(&sqlite3_open_v2) open_v2 = nullptr;
  decltype(&sqlite3_prepare_v2) prepare_v2 = nullptr;
  decltype(&sqlite3_step) step = nullptr;
};

// NotFound with the name of the package. Repeating it is harmless; thread-safe.
absl::Status LoadSqlite();
// Only after LoadSqlite() was OK.
const SqliteFunctions& Sqlite();

}  // namespace meshwright
