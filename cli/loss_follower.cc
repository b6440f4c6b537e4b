// SPDX-License-Identifier: Apache-2.0
#include "cli/loss_follower.h"

#include <utility>
#include <vector>

#include <absl/strings/str_cat.h>

#include "tools/loss_accounting/loss_accounting.h"

#include "common/base/bad_input.h"
#include "common/base/status_macros.h"
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

  absl::Status Account(const std::string& ply_path, nlohmann::ordered_json& report) override {
    MW_ASSIGN_OR_RETURN(TriangleMesh mesh, ReadPly(ply_path));
    ChangeOffset(offset_, mesh);
    const LossReport lost = losses_.Account(mesh, pool_);
    report["losses"] = ToJson(lost);
    words_ = ToText(lost);
    return absl::OkStatus();
  }

  const std::string& Words() const override { return words_; }

 private:
  const CameraJobOptions& options_;
  ThreadPool& pool_;
  const Eigen::Vector3d offset_;  // of all meshes and the cameras
  LossAccounting losses_;
  std::string words_;
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
