#include "coordinator/api/reconstruction_record.h"

#include <algorithm>
#include <filesystem>
#include <utility>

#include <absl/strings/str_cat.h>
#include <nlohmann/json.hpp>

#include "common/base/files.h"
#include "common/base/status_macros.h"

namespace meshwright {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr char kSuffix[] = ".json";
constexpr size_t kMaxIdLength = 64;

}  // namespace

std::string EncodeRecord(const ReconstructionRecord& record) {
  Json json;
  json["id"] = record.id;
  json["state"] = v1::ReconstructionState_Name(record.state);
  json["deleted"] = record.deleted;
  json["failure"] = record.failure;
  json["options"] = record.options_json;
  json["scene_reference"] = record.scene_reference;
  json["weight"] = record.weight;
  json["created_unix_us"] = absl::ToUnixMicros(record.created);
  if (record.finished != absl::InfinitePast()) json["finished_unix_us"] = absl::ToUnixMicros(record.finished);
  json["scene_blob"] = record.scene_blob;
  json["mesh_bytes"] = record.mesh_bytes;
  json["mesh_sha256"] = record.mesh_sha256;
  json["vertices"] = record.vertices;
  json["faces"] = record.faces;
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

absl::StatusOr<ReconstructionRecord> DecodeRecord(const std::string& text) {
  ReconstructionRecord record;
  try {
    const Json json = Json::parse(text);
    record.id = json.at("id").get<std::string>();
    if (!v1::ReconstructionState_Parse(json.at("state").get<std::string>(), &record.state)) {
      return absl::DataLossError(absl::StrCat("state is ", json.at("state").dump(), ", expected one that is known"));
    }
    record.deleted = json.at("deleted").get<bool>();
    record.failure = json.at("failure").get<std::string>();
    record.options_json = json.at("options").get<std::string>();
    record.scene_reference = json.at("scene_reference").get<std::string>();
    record.weight = json.at("weight").get<double>();
    record.created = absl::FromUnixMicros(json.at("created_unix_us").get<int64_t>());
    if (json.contains("finished_unix_us")) {
      record.finished = absl::FromUnixMicros(json.at("finished_unix_us").get<int64_t>());
    }
    record.scene_blob = json.at("scene_blob").get<std::string>();
    record.mesh_bytes = json.at("mesh_bytes").get<int64_t>();
    record.mesh_sha256 = json.at("mesh_sha256").get<std::string>();
    record.vertices = json.at("vertices").get<int64_t>();
    record.faces = json.at("faces").get<int64_t>();
  } catch (const Json::exception& error) {
    return absl::DataLossError(absl::StrCat("not a reconstruction's record: ", error.what()));
  }
  return record;
}

absl::StatusOr<RecordFolder> RecordFolder::Open(const std::string& folder) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) return absl::PermissionDeniedError(absl::StrCat(folder, ": cannot make the folder: ", error.message()));
  return RecordFolder(folder);
}

absl::Status RecordFolder::Save(const ReconstructionRecord& record) const {
  return WriteFileAtomically(absl::StrCat(folder_, "/", record.id, kSuffix), EncodeRecord(record));
}

absl::StatusOr<std::vector<ReconstructionRecord>> RecordFolder::LoadAll() const {
  std::vector<std::string> paths;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(folder_, error)) {
    if (entry.path().extension() == kSuffix) paths.push_back(entry.path().string());
  }
  if (error) return absl::PermissionDeniedError(absl::StrCat(folder_, ": cannot look into it: ", error.message()));
  std::sort(paths.begin(), paths.end());
  std::vector<ReconstructionRecord> records;
  for (const std::string& path : paths) {
    MW_ASSIGN_OR_RETURN(const std::string text, ReadFile(path));
    absl::StatusOr<ReconstructionRecord> record = DecodeRecord(text);
    if (!record.ok()) {
      return absl::Status(record.status().code(), absl::StrCat(path, ": ", std::string(record.status().message())));
    }
    records.push_back(*std::move(record));
  }
  return records;
}

absl::Status ValidateReconstructionId(const std::string& id) {
  const auto plain = [](char c) { return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9'); };
  const bool valid = !id.empty() && id.size() <= kMaxIdLength && plain(id.front()) &&
                     std::all_of(id.begin(), id.end(), [&](char c) { return plain(c) || c == '-'; });
  if (valid) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat("id has ", id.size(),
                                                 " characters or one that is not allowed; expected 1..", kMaxIdLength,
                                                 " of a-z, 0-9 and \"-\", a letter or digit first"));
}

}  // namespace meshwright
