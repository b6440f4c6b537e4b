// SPDX-License-Identifier: Apache-2.0
// Which blobs belong to whom: scenes' files, held blobs, damaged ones.
#include "common/base/status_macros.h"
#include "coordinator/store/sql_job_store.h"

namespace meshwright {
namespace {

std::vector<std::string> FirstColumn(const SqlResult& result) {
  std::vector<std::string> texts;
  texts.reserve(result.rows.size());
  for (const SqlRow& row : result.rows) texts.push_back(row.Text(0));
  return texts;
}

}  // namespace

absl::Status SqlJobStore::PutSceneFile(const std::string& id, const SceneFile& file) {
  return database_
      ->Run("put_scene_file",
            {{"id", id}, {"path", file.path}, {"size_bytes", file.size_bytes}, {"digest", file.digest}})
      .status();
}

absl::StatusOr<std::vector<SceneFile>> SqlJobStore::ListSceneFiles(const std::string& id) {
  MW_ASSIGN_OR_RETURN(const SqlResult result, database_->Run("list_scene_files", {{"id", id}}));
  std::vector<SceneFile> files;
  files.reserve(result.rows.size());
  for (const SqlRow& row : result.rows) {
    files.push_back({.path = row.Text(0), .size_bytes = row.Integer(1), .digest = row.Text(2)});
  }
  return files;
}

absl::StatusOr<bool> SqlJobStore::AddBlobRef(const std::string& id, const std::string& digest) {
  MW_ASSIGN_OR_RETURN(const SqlResult held, database_->Run("hold_blob", {{"id", id}, {"digest", digest}}));
  if (held.changed == 0) MW_RETURN_IF_ERROR(GetReconstruction(id).status());
  // After the row is there, and only then: who deletes marks the blob first and looks for rows then, so that one of
  // the two sees the other.
  MW_ASSIGN_OR_RETURN(const SqlResult vanishing, database_->Run("is_blob_vanishing", {{"digest", digest}}));
  return vanishing.rows.empty();
}

absl::StatusOr<std::vector<std::string>> SqlJobStore::MarkBlobsForDeletion(const std::string& id) {
  MW_RETURN_IF_ERROR(database_->Run("let_blobs_vanish", {{"id", id}}).status());
  MW_ASSIGN_OR_RETURN(const SqlResult result, database_->Run("list_vanishing_blobs", {{"id", id}}));
  return FirstColumn(result);
}

absl::Status SqlJobStore::ReportDamagedBlob(const std::string& id, const std::string& digest) {
  return database_->Run("report_damaged_blob", {{"id", id}, {"digest", digest}}).status();
}

absl::StatusOr<std::vector<std::string>> SqlJobStore::ListDamagedBlobs(const std::string& id) {
  MW_ASSIGN_OR_RETURN(const SqlResult result, database_->Run("list_damaged_blobs", {{"id", id}}));
  return FirstColumn(result);
}

absl::Status SqlJobStore::ForgetDamagedBlob(const std::string& id, const std::string& digest) {
  return database_->Run("forget_damaged_blob", {{"id", id}, {"digest", digest}}).status();
}

}  // namespace meshwright
