// SPDX-License-Identifier: Apache-2.0
#include "coordinator/api/reconstruction_record.h"

#include <algorithm>
#include <utility>

#include <absl/strings/ascii.h>
#include <absl/strings/str_cat.h>
#include <google/protobuf/util/json_util.h>

#include "coordinator/api/public_text.h"
#include "coordinator/dispatch/proto_times.h"
#include "coordinator/dispatch/public_numbers.h"

namespace meshwright {
namespace {

constexpr size_t kMaxIdLength = 64;
constexpr double kThousandths = 1000;
constexpr std::pair<const char*, v1::AttemptEnding> kEndings[] = {{"finished", v1::ATTEMPT_ENDING_FINISHED},
                                                                  {"failed", v1::ATTEMPT_ENDING_FAILED},
                                                                  {"out_of_memory", v1::ATTEMPT_ENDING_OUT_OF_MEMORY},
                                                                  {"lost", v1::ATTEMPT_ENDING_LOST},
                                                                  {"released", v1::ATTEMPT_ENDING_RELEASED}};

}  // namespace

std::string InWords(v1::ReconstructionState state) {
  constexpr char kPrefix[] = "RECONSTRUCTION_STATE_";
  return absl::AsciiStrToLower(v1::ReconstructionState_Name(state).substr(sizeof(kPrefix) - 1));
}

v1::ReconstructionState ToProto(ReconstructionState state) {
  switch (state) {
    case ReconstructionState::kCreated:
      return v1::RECONSTRUCTION_STATE_CREATED;
    case ReconstructionState::kPreparing:
      return v1::RECONSTRUCTION_STATE_PREPARING;
    case ReconstructionState::kRunning:
      return v1::RECONSTRUCTION_STATE_RUNNING;
    case ReconstructionState::kJoining:
      return v1::RECONSTRUCTION_STATE_JOINING;
    case ReconstructionState::kDone:
      return v1::RECONSTRUCTION_STATE_DONE;
    case ReconstructionState::kCancelled:
      return v1::RECONSTRUCTION_STATE_CANCELLED;
    case ReconstructionState::kFailed:
      return v1::RECONSTRUCTION_STATE_FAILED;
    case ReconstructionState::kDeleting:
      break;
  }
  return v1::RECONSTRUCTION_STATE_UNSPECIFIED;
}

v1::Reconstruction ToProto(const Reconstruction& stored) {
  v1::Reconstruction reconstruction;
  reconstruction.set_id(stored.id);
  reconstruction.set_state(ToProto(stored.state));
  if (stored.state == ReconstructionState::kFailed) reconstruction.set_failure(WithoutServerPaths(stored.state_reason));
  reconstruction.set_options_json(stored.options_json);
  reconstruction.set_scene_reference(stored.scene_reference);
  reconstruction.set_weight(stored.weight);
  FillTime(stored.created_at, *reconstruction.mutable_create_time());
  if (stored.finished_at != absl::InfinitePast()) FillTime(stored.finished_at, *reconstruction.mutable_finish_time());
  const bool is_worked_on =
      stored.state == ReconstructionState::kRunning || stored.state == ReconstructionState::kJoining;
  if (is_worked_on && stored.progress.expected_end != absl::InfinitePast()) {
    FillTime(stored.progress.expected_end, *reconstruction.mutable_expected_finish_time());
  }
  if (stored.state == ReconstructionState::kJoining) {
    reconstruction.set_stage(absl::StrCat("joining the mesh, ", stored.progress.joined_thousandths / 10, " %"));
  }
  reconstruction.set_mesh_bytes(stored.mesh.bytes);
  reconstruction.set_mesh_sha256(stored.mesh.digest);
  if (stored.state == ReconstructionState::kDone && !stored.mesh.verdict_json.empty()) {
    google::protobuf::util::JsonParseOptions lenient;
    lenient.ignore_unknown_fields = true;  // of later programs
    v1::Verdict verdict;
    if (google::protobuf::util::JsonStringToMessage(stored.mesh.verdict_json, &verdict, lenient).ok()) {
      *reconstruction.mutable_verdict() = std::move(verdict);
    }
  }
  v1::Progress& progress = *reconstruction.mutable_progress();
  progress.set_cameras_total(static_cast<int32_t>(stored.progress.cameras_total));
  progress.set_cameras_committed(static_cast<int32_t>(stored.progress.cameras_committed));
  progress.set_cameras_skipped(static_cast<int32_t>(stored.progress.cameras_skipped));
  progress.set_cameras_in_flight(static_cast<int32_t>(stored.progress.cameras_in_flight));
  progress.set_patches_filtered(stored.progress.patches_filtered);
  progress.set_patches_accepted(stored.progress.patches_accepted);
  progress.set_joined_share(static_cast<double>(stored.progress.joined_thousandths) / kThousandths);
  progress.set_vertices(stored.mesh.vertices);
  progress.set_faces(stored.mesh.faces);
  return reconstruction;
}

v1::Attempt ToProto(const std::string& reconstruction, const Attempt& stored) {
  v1::Attempt attempt;
  attempt.set_reconstruction_id(reconstruction);
  attempt.set_sequence(PublicSequence(stored.sequence));
  attempt.set_camera(PublicCamera(stored.camera));
  attempt.set_epoch(stored.epoch);
  attempt.set_worker(stored.worker);
  FillTime(stored.began_at, *attempt.mutable_begin_time());
  FillTime(stored.ended_at, *attempt.mutable_end_time());
  for (const auto& [text, ending] : kEndings) {
    if (stored.ending == text) attempt.set_ending(ending);
  }
  attempt.set_reason(WithoutServerPaths(stored.reason));
  return attempt;
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
