// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "pipeline/texturing/face_graph.h"
#include "pipeline/texturing/face_views.h"
#include "pipeline/texturing/triangle_raster.h"

#include "common/base/ids.h"
#include "common/geometry/camera.h"
#include "common/mesh/triangle_mesh.h"

namespace meshwright {

// Faces side by side that get their colours from one photograph: a piece of it, cut out as it is.
struct Chart {
  int32_t label = 0;            // the photograph; kNoLabel: none sees the face, which is a chart by itself
  std::vector<uint32_t> faces;  // ascending
  PixelBox box;                 // in the photograph, a pixel of its surroundings included; any place for kNoLabel
};

// The photograph of each face (kNoLabel: none): good ones, few changes (Waechter et al. 2014, section 4.1), and no
// charts of a few faces where their neighbours' photograph shows them too.
std::vector<int32_t> ChooseLabels(const FaceViews& views, const std::vector<InnerEdge>& edges, double seam_cost);

// Sorted by label, those without a photograph last. `cameras`: what labels stand for.
std::vector<Chart> MakeCharts(const TriangleMesh& mesh, const std::vector<InnerEdge>& edges,
                              const std::vector<int32_t>& labels, const std::vector<Camera>& cameras);

}  // namespace meshwright
