#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <absl/time/time.h>

#include "meshwright/v1/reconstruction.pb.h"

namespace meshwright {

// What must be known about a reconstruction beside the JobStore's rows: how it was asked for and how far it is.
struct ReconstructionRecord {
  std::string id;
  v1::ReconstructionState state = v1::RECONSTRUCTION_STATE_CREATED;
  bool deleted = false;  // its id stays taken
  std::string failure;
  std::string options_json;     // canonical: all options
  std::string scene_reference;  // "" when uploaded
  double weight = 1;
  absl::Time created;
  absl::Time finished = absl::InfinitePast();
  std::string scene_blob;  // "" until the scene is in the BlobStore
  int64_t mesh_bytes = 0;
  std::string mesh_sha256;
  int64_t vertices = 0;
  int64_t faces = 0;
};

std::string EncodeRecord(const ReconstructionRecord& record);
// DataLoss when it is not what EncodeRecord makes.
absl::StatusOr<ReconstructionRecord> DecodeRecord(const std::string& json);

// Records as files ID.json in one folder, each replaced atomically. Thread-safe for different ids.
class RecordFolder {
 public:
  // Makes the folder when it is not there.
  static absl::StatusOr<RecordFolder> Open(const std::string& folder);
  absl::Status Save(const ReconstructionRecord& record) const;
  absl::StatusOr<std::vector<ReconstructionRecord>> LoadAll() const;  // by id

 private:
  explicit RecordFolder(std::string folder) : folder_(std::move(folder)) {}
  std::string folder_;
};

// 1 to 64 characters of a-z, 0-9 and "-", a letter or digit first. InvalidArgument names the field `id`.
absl::Status ValidateReconstructionId(const std::string& id);

}  // namespace meshwright
