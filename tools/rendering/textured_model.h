// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>
#include <absl/status/statusor.h>

#include "tools/raycast/mesh_ray_caster.h"

#include "common/base/thread_pool.h"
#include "common/geometry/camera.h"
#include "common/image/color_image.h"
#include "common/mesh/triangle_mesh.h"

namespace meshwright {

// A mesh with a texture atlas, as a GLB of ours holds it, in the scene's coordinates.
struct TexturedModel {
  TriangleMesh mesh;                                 // positions and faces, cut at the borders of charts
  std::vector<Eigen::Vector2f> texture_coordinates;  // of vertices; (0, 0) is a page's top-left corner
  std::vector<int32_t> pages_of_faces;
  std::vector<ColorImage> pages;
};

// Reads a GLB that has positions, texture coordinates and pictures inside, as TexturedMeshWriter writes it; other parts
// of glTF are not for this. InvalidArgument names what is missing.
absl::StatusOr<TexturedModel> ReadTexturedGlb(const std::string& path);

// Pictures of a textured model: four samples a pixel, texture linear between its pixels.
class TexturedModelRenderer {
 public:
  // `model` outlives the renderer.
  explicit TexturedModelRenderer(const TexturedModel& model) : model_(model), caster_(model.mesh) {}

  ColorImage Render(const Camera& camera, const std::array<uint8_t, 3>& background, ThreadPool& pool) const;
  const MeshRayCaster& caster() const { return caster_; }

 private:
  const TexturedModel& model_;
  const MeshRayCaster caster_;
};

// Colour of a face at barycentric coordinates u, v of its second and third corner.
Eigen::Vector3f ColorAt(const TexturedModel& model, int32_t face, float u, float v);

// How much grey levels change across edges of the model, at points half a pixel of the texture to each side.
struct EdgeJumps {
  double at_seams = 0;       // mean of |difference| over edges between two charts
  double within_charts = 0;  // over all others
  int64_t seams = 0;
};
EdgeJumps MeasureEdgeJumps(const TexturedModel& model);

}  // namespace meshwright
