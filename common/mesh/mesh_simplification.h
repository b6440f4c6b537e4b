// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <utility>
#include <vector>

#include <Eigen/Core>

namespace meshwright {

// Fewer triangles for nearly the same surface: edges collapse into one of their ends, those first that change least by
// quadric error (Garland and Heckbert, 1997; meshoptimizer), until `max_error` (scene units, >= 0) is reached. It
// bounds the root mean square of the distances to the planes of the triangles that a vertex stands for; single points
// that are left out can lie a few times as far from the new surface. The result depends on the arguments alone.
//
// `faces`: every edge has one or two triangles, two in opposite directions, and every vertex one fan; so it is
// afterwards. Edges with one triangle stay, and with them their vertices. No new edge runs along one of `other_edges`
// (from, to), which belong to triangles outside of `faces`. Corners index `positions`, before and after.
std::vector<std::array<uint32_t, 3>> SimplifyFaces(const std::vector<Eigen::Vector3f>& positions,
                                                   const std::vector<std::array<uint32_t, 3>>& faces, double max_error,
                                                   const std::vector<std::pair<uint32_t, uint32_t>>& other_edges);

}  // namespace meshwright
