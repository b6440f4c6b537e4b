// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>

#include <Eigen/Core>

#include "tools/raycast/mesh_ray_caster.h"

#include "common/base/thread_pool.h"
#include "common/geometry/camera.h"
#include "common/image/color_image.h"
#include "common/mesh/triangle_mesh.h"

namespace meshwright {

enum class Shading {
  kColors,   // the vertices' colours as they are; kNormals when the mesh has none
  kNormals,  // grey, lit from the camera; what is seen from behind is red
  kCameras,  // one colour per reference camera, lit from the camera; kNormals when the mesh has none
};

struct RenderOptions {
  Shading shading = Shading::kNormals;
  std::array<uint8_t, 3> background = {255, 255, 255};  // RGB
  int point_radius = 1;  // px; half the side of the squares that stand for the points of a cloud
};

// Pictures of a mesh or point cloud from any camera, for looking at results.
class MeshRenderer {
 public:
  // `mesh` must outlive the renderer; its face indices must be vertices.
  explicit MeshRenderer(const TriangleMesh& mesh);

  // Four samples a pixel. The same picture whatever the number of threads.
  ColorImage Render(const Camera& camera, const RenderOptions& options, ThreadPool& pool) const;

  const MeshRayCaster& caster() const { return caster_; }

  // The point on the camera's optical axis at the median depth of what it sees; of the vertices before it when the
  // camera's rays meet nothing; one unit in front when there are none. A pivot for OrbitCamera.
  Eigen::Vector3d Pivot(const Camera& camera, ThreadPool& pool) const;

 private:
  ColorImage RenderPoints(const Camera& camera, const RenderOptions& options) const;

  const TriangleMesh& mesh_;
  MeshRayCaster caster_;
};

// The camera moved on a sphere around `pivot`, looking at it as before: `yaw` to its right, `pitch` upwards (radians).
Camera OrbitCamera(const Camera& camera, const Eigen::Vector3d& pivot, double yaw, double pitch);

}  // namespace meshwright
