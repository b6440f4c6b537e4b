// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <string>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "common/blob/blob_store.h"
#include "common/scene/scene.h"
#include "coordinator/api/reconstruction_service.h"
#include "coordinator/nodeodm/odm_task.h"
#include "coordinator/nodeodm/zip_archive.h"

namespace meshwright {

// Writes the mesh of a PLY file as GLB with a texture cut from the photographs; image_path of each view is a file.
// FailedPrecondition when no photograph shows anything of it.
using WriteTexturedGlb = std::function<absl::Status(const Scene& scene, const std::string& options_json,
                                                    const std::string& ply_path, const std::string& glb_path)>;

// What all.zip of a finished task has, in a folder of its own.
class ResultPackage {
 public:
  struct Sources {
    const ReconstructionService* reconstructions = nullptr;
    BlobStore* blobs = nullptr;
    WriteTexturedGlb write_textured_glb;
  };

  // Makes the folder anew: the textured model (the one with colours at its vertices where no texture can be cut),
  // points, mesh, cameras and report. `output`: the task's lines.
  static absl::Status Make(const OdmTask& task, bool skips_model, const std::vector<std::string>& output,
                           const Sources& sources, const std::string& folder);

  // The files that were made and that `outputs` names (a file, or a folder with all below it; none: all).
  static absl::StatusOr<std::vector<ZipEntry>> Entries(const std::string& folder,
                                                       const std::vector<std::string>& outputs);
};

}  // namespace meshwright
