// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "pipeline/texturing/charts.h"
#include "pipeline/texturing/seam_leveling.h"
#include "pipeline/texturing/seams.h"

#include "common/geometry/camera.h"
#include "common/image/color_image.h"
#include "common/mesh/triangle_mesh.h"

namespace meshwright {

// The pixels of a chart's box.
struct PaintedChart {
  ColorImage image;
  std::vector<uint8_t> covered;  // 1: has a colour
};

// Cuts a chart out of its photograph, adds the offsets of its vertices, and closes what is left of the gaps at its
// seams: half of each, fading over a strip of kStripPixels as Poisson image editing does (section 4.3). Pixels up to
// one beyond the chart's border come from the photograph too. Without `adjust` the photograph stays as it is.
constexpr int kStripPixels = 20;
PaintedChart PaintChart(const TriangleMesh& mesh, const Chart& chart, int32_t chart_number, const Camera& camera,
                        const ColorImage& photograph, const Seams& seams, const VertexOffsets& offsets, bool adjust);

// A face that no photograph shows, by the colours of its corners. UnseenCorners: where these are in the box, px.
PaintedChart PaintUnseenFace(const PixelBox& box, const std::array<Eigen::Vector3f, 3>& corner_colors);
std::array<Eigen::Vector2d, 3> UnseenCorners(const PixelBox& box);

}  // namespace meshwright
