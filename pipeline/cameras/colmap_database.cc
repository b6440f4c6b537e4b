// SPDX-License-Identifier: Apache-2.0
#include "pipeline/cameras/colmap_database.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <utility>

#include <absl/strings/str_cat.h>
#include <sqlite3.h>

#include "pipeline/cameras/nearest_descriptors.h"
#include "pipeline/cameras/sqlite_library.h"

#include "common/base/status_macros.h"

namespace meshwright {
namespace {

constexpr int64_t kSimpleRadial = 2;  // COLMAP's numbers of its models
constexpr int64_t kOpenCv = 4;
constexpr int64_t kPairFactor = 2147483647;  // pair_id = this times the smaller image's number + the larger one's
constexpr int kFewestMatches = 15;           // COLMAP's min_num_matches
constexpr int kLockTimeoutMs = 10'000;

// A prepared statement that ends itself.
class Statement {
 public:
  Statement(sqlite3* connection, const std::string& sql) {
    Sqlite().prepare_v2(connection, sql.c_str(), -1, &statement_, nullptr);
  }
  Statement(const Statement&) = delete;
  Statement& operator=(const Statement&) = delete;
  ~Statement() { Sqlite().finalize(statement_); }

  bool valid() const { return statement_ != nullptr; }
  void Bind(int at, int64_t value) { Sqlite().bind_int64(statement_, at, value); }
  void Bind(int at, const std::string& text) {
    Sqlite().bind_text(statement_, at, text.data(), static_cast<int>(text.size()), SQLITE_TRANSIENT);
  }
  // `bytes` lives until the statement ends.
  void BindBlob(int at, const void* bytes, size_t size) {
    Sqlite().bind_blob(statement_, at, bytes, static_cast<int>(size), SQLITE_STATIC);
  }
  int Step() { return Sqlite().step(statement_); }
  int64_t Integer(int column) { return Sqlite().column_int64(statement_, column); }
  std::string Blob(int column) {
    const auto* bytes = static_cast<const char*>(Sqlite().column_blob(statement_, column));
    return bytes == nullptr ? "" : std::string(bytes, static_cast<size_t>(Sqlite().column_bytes(statement_, column)));
  }
  std::string Text(int column) {
    const auto* text = reinterpret_cast<const char*>(Sqlite().column_text(statement_, column));
    return text == nullptr ? "" : text;
  }

 private:
  sqlite3_stmt* statement_ = nullptr;
};

std::string Parameters(const CameraGroup& group) {
  std::vector<double> values = {group.focal_px, group.size.width / 2.0, group.size.height / 2.0, 0};
  if (group.wide_model) {
    values = {group.focal_px, group.focal_px, group.size.width / 2.0, group.size.height / 2.0, 0, 0, 0, 0};
  }
  return std::string(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(double));
}

}  // namespace

absl::StatusOr<std::unique_ptr<ColmapDatabase>> ColmapDatabase::Open(const std::string& path) {
  MW_RETURN_IF_ERROR(LoadSqlite());
  auto database = std::unique_ptr<ColmapDatabase>(new ColmapDatabase(path));
  if (Sqlite().open_v2(path.c_str(), &database->connection_, SQLITE_OPEN_READWRITE, nullptr) != SQLITE_OK) {
    return database->Error();
  }
  Sqlite().busy_timeout(database->connection_, kLockTimeoutMs);
  MW_ASSIGN_OR_RETURN(const std::vector<int64_t> rigs,
                      database->Integers("SELECT count(*) FROM sqlite_master WHERE name = 'rigs'"));
  if (rigs.front() > 0) {
    return absl::FailedPreconditionError(
        absl::StrCat(path, ": made by COLMAP 3.12 or later, which keeps rigs; expected COLMAP 3.6 to 3.11"));
  }
  return database;
}

ColmapDatabase::~ColmapDatabase() { Sqlite().close(connection_); }

absl::Status ColmapDatabase::Error() const {
  return absl::InternalError(absl::StrCat(path_, ": ", Sqlite().errmsg(connection_)));
}

absl::Status ColmapDatabase::Execute(const std::string& sql) {
  if (Sqlite().exec(connection_, sql.c_str(), nullptr, nullptr, nullptr) != SQLITE_OK) return Error();
  return absl::OkStatus();
}

absl::StatusOr<std::vector<int64_t>> ColmapDatabase::Integers(const std::string& sql) {
  Statement statement(connection_, sql);
  if (!statement.valid()) return Error();
  std::vector<int64_t> values;
  int result = SQLITE_ROW;
  while ((result = statement.Step()) == SQLITE_ROW) values.push_back(statement.Integer(0));
  if (result != SQLITE_DONE) return Error();
  return values;
}

absl::Status ColmapDatabase::PutCamera(int64_t id, const CameraGroup& group) {
  Statement statement(connection_,
                      "INSERT OR REPLACE INTO cameras(camera_id, model, width, height, params, prior_focal_length) "
                      "VALUES(?, ?, ?, ?, ?, ?)");
  if (!statement.valid()) return Error();
  statement.Bind(1, id);
  statement.Bind(2, group.wide_model ? kOpenCv : kSimpleRadial);
  statement.Bind(3, int64_t{group.size.width});
  statement.Bind(4, int64_t{group.size.height});
  const std::string parameters = Parameters(group);
  statement.BindBlob(5, parameters.data(), parameters.size());
  statement.Bind(6, int64_t{group.focal_from_exif ? 1 : 0});
  return statement.Step() == SQLITE_DONE ? absl::OkStatus() : Error();
}

absl::Status ColmapDatabase::PutImage(int64_t id, int64_t camera, const std::string& name) {
  Statement statement(connection_,
                      "INSERT INTO images(image_id, name, camera_id) VALUES(?1, ?2, ?3) "
                      "ON CONFLICT(image_id) DO UPDATE SET name = ?2");
  if (!statement.valid()) return Error();
  statement.Bind(1, id);
  statement.Bind(2, name);
  statement.Bind(3, camera);
  return statement.Step() == SQLITE_DONE ? absl::OkStatus() : Error();
}

absl::Status ColmapDatabase::Fill(const std::vector<CameraGroup>& groups, const std::vector<std::string>& names) {
  for (size_t i = 0; i < groups.size(); ++i) {
    const auto camera = static_cast<int64_t>(i) + 1;
    MW_RETURN_IF_ERROR(PutCamera(camera, groups[i]));
    for (const size_t photograph : groups[i].photographs) {
      MW_RETURN_IF_ERROR(PutImage(static_cast<int64_t>(photograph) + 1, camera, names[photograph]));
    }
  }
  return absl::OkStatus();
}

absl::Status ColmapDatabase::PutPhotographs(const std::vector<CameraGroup>& groups,
                                            const std::vector<std::string>& names) {
  return InTransaction([&] { return Fill(groups, names); });
}

absl::Status ColmapDatabase::InTransaction(const std::function<absl::Status()>& change) {
  MW_RETURN_IF_ERROR(Execute("BEGIN IMMEDIATE"));
  absl::Status changed = change();
  if (changed.ok()) return Execute("COMMIT");
  static_cast<void>(Execute("ROLLBACK"));
  return changed;
}

absl::StatusOr<ColmapDatabase::Array> ColmapDatabase::ReadArray(const std::string& table, int64_t image,
                                                                size_t value_bytes) {
  Statement statement(connection_, absl::StrCat("SELECT rows, cols, data FROM ", table, " WHERE image_id = ?"));
  if (!statement.valid()) return Error();
  statement.Bind(1, image);
  const int result = statement.Step();
  if (result == SQLITE_DONE) return Array();
  if (result != SQLITE_ROW) return Error();
  Array array = {statement.Integer(0), statement.Integer(1), statement.Blob(2)};
  const auto expected = static_cast<uint64_t>(array.rows) * static_cast<uint64_t>(array.columns) * value_bytes;
  if (array.rows < 0 || array.columns < 0 || array.bytes.size() != expected) {
    return absl::InternalError(absl::StrCat(path_, ": ", table, " of image ", image, " have ", array.bytes.size(),
                                            " bytes, expected ", array.rows, " times ", array.columns, " numbers of ",
                                            value_bytes, " bytes"));
  }
  return array;
}

absl::StatusOr<std::string> ColmapDatabase::Descriptors(int64_t image) {
  MW_ASSIGN_OR_RETURN(Array array, ReadArray("descriptors", image, 1));
  if (array.rows > 0 && array.columns != static_cast<int64_t>(kDescriptorBytes)) {
    return absl::InternalError(absl::StrCat(path_, ": descriptors of image ", image, " have ", array.columns,
                                            " bytes each, expected ", kDescriptorBytes));
  }
  return std::move(array.bytes);
}

// A feature is x, y, and the matrix that a unit square becomes, or x, y, scale and orientation.
absl::StatusOr<std::vector<float>> ColmapDatabase::FeatureScales(int64_t image) {
  MW_ASSIGN_OR_RETURN(const Array array, ReadArray("keypoints", image, sizeof(float)));
  std::vector<float> scales;
  const auto columns = static_cast<size_t>(array.columns);
  for (size_t i = 0; i < static_cast<size_t>(array.rows); ++i) {
    float values[6] = {};
    std::memcpy(values, &array.bytes[i * columns * sizeof(float)], std::min<size_t>(columns, 6) * sizeof(float));
    scales.push_back(columns < 6 ? values[2] : std::hypot(values[2], values[4]));
  }
  return scales;
}

absl::StatusOr<std::set<ImagePair>> ColmapDatabase::MatchedPairs() {
  MW_ASSIGN_OR_RETURN(const std::vector<int64_t> ids, Integers("SELECT pair_id FROM matches"));
  std::set<ImagePair> pairs;
  for (const int64_t id : ids) pairs.insert({id / kPairFactor, id % kPairFactor});
  return pairs;
}

absl::Status ColmapDatabase::PutMatchesOfPair(const PairMatches& pair) {
  Statement statement(connection_, "INSERT OR REPLACE INTO matches(pair_id, rows, cols, data) VALUES(?, ?, 2, ?)");
  if (!statement.valid()) return Error();
  statement.Bind(1, pair.pair.first * kPairFactor + pair.pair.second);
  statement.Bind(2, static_cast<int64_t>(pair.matches.size()));
  statement.BindBlob(3, pair.matches.empty() ? "" : static_cast<const void*>(pair.matches.data()),
                     pair.matches.size() * sizeof(FeatureMatch));
  return statement.Step() == SQLITE_DONE ? absl::OkStatus() : Error();
}

absl::Status ColmapDatabase::PutMatches(const std::vector<PairMatches>& pairs) {
  return InTransaction([&] {
    for (const PairMatches& pair : pairs) MW_RETURN_IF_ERROR(PutMatchesOfPair(pair));
    return absl::OkStatus();
  });
}

absl::StatusOr<std::vector<int64_t>> ColmapDatabase::CountFeatures() {
  return Integers(
      "SELECT coalesce(keypoints.rows, 0) FROM images LEFT JOIN keypoints USING(image_id) ORDER BY images.image_id");
}

absl::StatusOr<PairCounts> ColmapDatabase::CountPairs() {
  PairCounts counts;
  MW_ASSIGN_OR_RETURN(const std::vector<int64_t> matched,
                      Integers(absl::StrCat("SELECT count(*) FROM matches WHERE rows >= ", kFewestMatches)));
  MW_ASSIGN_OR_RETURN(
      const std::vector<int64_t> verified,
      Integers(absl::StrCat("SELECT count(*) FROM two_view_geometries WHERE rows >= ", kFewestMatches)));
  counts.matched = matched.front();
  counts.verified = verified.front();
  return counts;
}

absl::StatusOr<std::string> ColmapDatabase::StartVerification() {
  MW_RETURN_IF_ERROR(Execute("DELETE FROM two_view_geometries"));
  MW_ASSIGN_OR_RETURN(
      const std::vector<int64_t> pairs,
      Integers(absl::StrCat("SELECT pair_id FROM matches WHERE rows >= ", kFewestMatches, " ORDER BY pair_id")));
  std::vector<std::string> names;
  Statement statement(connection_, "SELECT name FROM images ORDER BY image_id");
  if (!statement.valid()) return Error();
  while (statement.Step() == SQLITE_ROW) names.push_back(statement.Text(0));
  std::string lines;
  for (const int64_t pair : pairs) {
    const auto first = static_cast<size_t>(pair / kPairFactor);
    const auto second = static_cast<size_t>(pair % kPairFactor);
    if (first < 1 || second < 1 || first > names.size() || second > names.size()) continue;
    absl::StrAppend(&lines, names[first - 1], " ", names[second - 1], "\n");
  }
  return lines;
}

}  // namespace meshwright
