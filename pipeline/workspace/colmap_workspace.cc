// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <filesystem>
#include <utility>
#include <vector>

#include <absl/strings/str_cat.h>

#include "pipeline/texturing/depth_raster.h"
#include "pipeline/workspace/undistorted_scene.h"
#include "pipeline/workspace/workspace.h"

#include "common/base/files.h"
#include "common/base/status_macros.h"
#include "common/scene/formats/export_colmap.h"

namespace meshwright {
namespace {

namespace fs = std::filesystem;

// COLMAP's file of an array: "WIDTH&HEIGHT&CHANNELS&", then floats, channel after channel.
absl::Status WriteArray(const fs::path& path, int width, int height, int channels, const std::vector<float>& values) {
  std::error_code error;
  fs::create_directories(path.parent_path(), error);
  if (error) return absl::PermissionDeniedError(absl::StrCat(path.string(), ": cannot be made: ", error.message()));
  std::string bytes = absl::StrCat(width, "&", height, "&", channels, "&");
  bytes.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(float));
  return WriteFileAtomically(path.string(), bytes);
}

// Inverse depth is affine in the pixel on a plane, so its slope is that of the surface. Of the differences to both
// sides the smaller: the other may be across a silhouette. 0 where there is no neighbour.
double Slope(double before, double here, double after) {
  const double back = before > 0 ? here - before : 0;
  const double forth = after > 0 ? after - here : 0;
  if (!(before > 0)) return forth;
  if (!(after > 0)) return back;
  return std::abs(back) < std::abs(forth) ? back : forth;
}

struct Maps {
  std::vector<float> depth;    // 0: none
  std::vector<float> normals;  // three planes
};

Maps MapsOf(const DepthRaster& raster, const IgnoredPixels& ignored) {
  const Camera& camera = raster.camera();
  const size_t pixels = static_cast<size_t>(camera.width) * static_cast<size_t>(camera.height);
  Maps maps = {std::vector<float>(pixels, 0.0F), std::vector<float>(3 * pixels, 0.0F)};
  const auto inverse_depth = [&](int x, int y) -> double {
    const bool inside = x >= 0 && y >= 0 && x < camera.width && y < camera.height;
    return inside ? raster.NearestInverseDepth(x, y) : 0.0F;
  };
  const Eigen::Matrix3d k_transposed = camera.K().transpose();
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      const double w = inverse_depth(x, y);
      if (!(w > 0) || ignored.At(x, y)) continue;
      const double gx = Slope(inverse_depth(x - 1, y), w, inverse_depth(x + 1, y));
      const double gy = Slope(inverse_depth(x, y - 1), w, inverse_depth(x, y + 1));
      // m . (x, y, 1) = 1 / z on the plane, so K^T m is its normal, which points away from the camera.
      const Eigen::Vector3d m(gx, gy, w - gx * (x + 0.5) - gy * (y + 0.5));
      const Eigen::Vector3d normal = -(k_transposed * m).normalized();
      const size_t i = static_cast<size_t>(y) * static_cast<size_t>(camera.width) + static_cast<size_t>(x);
      maps.depth[i] = static_cast<float>(1 / w);
      for (int k = 0; k < 3; ++k) maps.normals[static_cast<size_t>(k) * pixels + i] = static_cast<float>(normal[k]);
    }
  }
  return maps;
}

}  // namespace

absl::Status WriteColmapWorkspace(const Scene& scene, TriangleMesh mesh, const WorkspaceSettings& settings,
                                  ThreadPool& pool, const WorkspaceProgress& progress) {
  ChangeOffset(scene.offset, mesh);
  const fs::path stereo = fs::path(settings.folder) / "stereo";
  std::string fusion;
  std::string patch_match;
  const auto write_maps = [&](const View& view, const std::string& name) -> absl::Status {
    const Maps maps = MapsOf(DepthRaster(mesh, view.camera, pool), view.ignored);
    const std::string file = name + ".geometric.bin";
    const int width = view.camera.width;
    const int height = view.camera.height;
    MW_RETURN_IF_ERROR(WriteArray(stereo / "depth_maps" / file, width, height, 1, maps.depth));
    MW_RETURN_IF_ERROR(WriteArray(stereo / "normal_maps" / file, width, height, 3, maps.normals));
    absl::StrAppend(&fusion, name, "\n");
    absl::StrAppend(&patch_match, name, "\n__auto__, 20\n");
    return absl::OkStatus();
  };
  MW_ASSIGN_OR_RETURN(const Scene undistorted, WriteUndistortedScene(scene, settings, progress, write_maps));
  MW_RETURN_IF_ERROR(ExportColmapText(undistorted, settings.folder + "/sparse"));
  MW_RETURN_IF_ERROR(WriteFileAtomically((stereo / "fusion.cfg").string(), fusion));
  return WriteFileAtomically((stereo / "patch-match.cfg").string(), patch_match);
}

}  // namespace meshwright
