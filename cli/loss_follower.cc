#include "cli/loss_follower.h"

#include <cstdio>
#include <utility>
#include <vector>

#include <absl/strings/str_cat.h>

#include "tools/loss_accounting/loss_accounting.h"

#include "common/base/bad_input.h"
#include "common/base/files.h"
#include "common/base/status_macros.h"
#include "common/json/json_text.h"
#include "common/mesh/ply.h"
#include "common/scene/view.h"

namespace meshwright {
namespace {

class AccountingFollower : public LossFollower {
 public:
  AccountingFollower(const TriangleMesh& ground_truth, std::vector<Camera> cameras, const CameraJobOptions& options,
                     ThreadPool& pool)
      : options_(options),
        pool_(pool),
        offset_(ground_truth.offset),
        losses_(ground_truth, std::move(cameras), options.lattice_step, pool) {}

  CameraJobResult RunJob(const CameraJobInput& input, ThreadPool& pool) override {
    PatchStacks grown;
    CameraJobResult result = RunFollowedCameraJob(input, options_, grown, pool);
    losses_.RecordJob(input, options_, grown, result.filtered, pool);
    return result;
  }

  void RecordAccepted(const PatchLattice& accepted) override { losses_.RecordAccepted(accepted); }

  absl::Status Account(const LocalSettings& settings, nlohmann::ordered_json& report) override {
    MW_ASSIGN_OR_RETURN(TriangleMesh mesh, ReadPly(settings.output_path));
    ChangeOffset(offset_, mesh);
    const LossReport lost = losses_.Account(mesh, pool_);
    report["losses"] = ToJson(lost);
    std::fputs(ToText(lost).c_str(), stderr);
    return WriteFileAtomically(settings.report_path, JsonText(report, 2) + "\n");
  }

 private:
  const CameraJobOptions& options_;
  ThreadPool& pool_;
  const Eigen::Vector3d offset_;  // of all meshes and the cameras
  LossAccounting losses_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<LossFollower>> FollowLosses(const std::string& ground_truth, const Scene& scene,
                                                           const ReconstructionOptions& options, ThreadPool& pool) {
  absl::StatusOr<TriangleMesh> mesh = ReadPly(ground_truth);
  if (!mesh.ok()) return BadInput(mesh.status());
  if (const absl::Status usable = LossAccounting::Check(*mesh); !usable.ok()) {
    return BadInput(absl::InvalidArgumentError(absl::StrCat(ground_truth, ": ", usable.message())));
  }
  ChangeOffset(scene.offset, *mesh);
  std::vector<Camera> cameras;
  for (const SceneView& view : scene.views) cameras.push_back(UndistortedCamera(view, options.max_image_size));
  return std::make_unique<AccountingFollower>(*mesh, std::move(cameras), options.job, pool);
}

}  // namespace meshwright
// SPDX-License-Identifier: Apache-2.0
