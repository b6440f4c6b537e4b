// SPDX-License-Identifier: Apache-2.0
#include <cstdint>
#include <string>
#include <utility>

#include "pipeline/workspace/undistorted_scene.h"
#include "pipeline/workspace/workspace.h"

#include "common/base/files.h"
#include "common/base/little_endian.h"
#include "common/base/status_macros.h"
#include "common/mesh/ply.h"

namespace meshwright {
namespace {

constexpr uint32_t kVersion = 2;

void AppendText(const std::string& text, std::string& bytes) {
  AppendLittleEndian(uint64_t{text.size()}, bytes);
  bytes += text;
}

template <typename Matrix>
void AppendRows(const Matrix& matrix, std::string& bytes) {
  for (Eigen::Index row = 0; row < matrix.rows(); ++row) {
    for (Eigen::Index column = 0; column < matrix.cols(); ++column) AppendLittleEndian(matrix(row, column), bytes);
  }
}

// A platform of one camera at its origin, and one pose.
void AppendPlatform(const SceneView& view, std::string& bytes) {
  const Lens& lens = view.lens;
  AppendText(view.name, bytes);
  AppendLittleEndian(uint64_t{1}, bytes);
  AppendText("", bytes);
  AppendLittleEndian(static_cast<uint32_t>(lens.width), bytes);
  AppendLittleEndian(static_cast<uint32_t>(lens.height), bytes);
  Eigen::Matrix3d k;
  k << lens.fx, lens.skew, lens.cx - 0.5, 0, lens.fy, lens.cy - 0.5, 0, 0, 1;  // its pixel centres are integers
  AppendRows(k, bytes);
  AppendRows(Eigen::Matrix3d(Eigen::Matrix3d::Identity()), bytes);
  AppendRows(Eigen::Vector3d(Eigen::Vector3d::Zero()), bytes);
  AppendLittleEndian(uint64_t{1}, bytes);
  const Eigen::Matrix3d& rotation = view.cam_from_world.rotation;
  AppendRows(rotation, bytes);
  AppendRows(Eigen::Vector3d(-(rotation.transpose() * view.cam_from_world.translation)), bytes);
}

std::string Encode(const Scene& scene) {
  std::string bytes = "MVSI";
  AppendLittleEndian(kVersion, bytes);
  AppendLittleEndian(uint32_t{0}, bytes);
  AppendLittleEndian(uint64_t{scene.views.size()}, bytes);
  for (const SceneView& view : scene.views) AppendPlatform(view, bytes);
  AppendLittleEndian(uint64_t{scene.views.size()}, bytes);
  for (uint32_t i = 0; i < scene.views.size(); ++i) {
    AppendText("images/" + scene.views[i].name, bytes);
    AppendLittleEndian(i, bytes);            // platform
    AppendLittleEndian(uint32_t{0}, bytes);  // camera
    AppendLittleEndian(uint32_t{0}, bytes);  // pose
  }
  AppendLittleEndian(uint64_t{scene.points.size()}, bytes);
  for (const SparsePoint& point : scene.points) {
    for (const double coordinate : point.x_in_world) AppendLittleEndian(static_cast<float>(coordinate), bytes);
    AppendLittleEndian(uint64_t{point.seen_by.size()}, bytes);
    for (const CameraIndex camera : point.seen_by) {
      AppendLittleEndian(static_cast<uint32_t>(camera), bytes);
      AppendLittleEndian(1.0F, bytes);  // confidence
    }
  }
  AppendLittleEndian(uint64_t{0}, bytes);  // normals
  AppendLittleEndian(uint64_t{scene.points.size()}, bytes);
  for (const SparsePoint& point : scene.points) {
    for (const size_t channel : {2, 1, 0}) AppendLittleEndian(point.rgb[channel], bytes);
  }
  for (int i = 0; i < 3; ++i) AppendLittleEndian(uint64_t{0}, bytes);  // lines, their normals and colours
  Eigen::Matrix4d transform = Eigen::Matrix4d::Identity();
  transform.topRightCorner<3, 1>() = scene.offset;
  AppendRows(transform, bytes);
  return bytes;
}

}  // namespace

absl::Status WriteOpenMvsWorkspace(const Scene& scene, TriangleMesh mesh, const WorkspaceSettings& settings,
                                   ThreadPool& pool, const WorkspaceProgress& progress) {
  MW_ASSIGN_OR_RETURN(const Scene undistorted,
                      WriteUndistortedScene(scene, settings, progress,
                                            [](const View&, const std::string&) { return absl::OkStatus(); }));
  ChangeOffset(scene.offset, mesh);
  mesh.offset.setZero();  // it is the transform of the scene's file
  MW_RETURN_IF_ERROR(WritePly(mesh, settings.folder + "/mesh.ply"));
  return WriteFileAtomically(settings.folder + "/scene.mvs", Encode(undistorted));
}

}  // namespace meshwright
