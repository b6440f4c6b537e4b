// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <vector>

#include <Eigen/Core>
#include <absl/types/span.h>

namespace meshwright {

// Triangles that close a loop of at least three corners, of all those without further vertices: the ones whose normals
// lie best with those of their corners, by the worst triangle, in each part of the loop by less area where that is
// equal (dynamic programming as in Barequet and Sharir 1995 with the order of weights of Liepa 2003, normals of corners
// in the place of dihedral angles). Time grows with the third power of the corners. Empty when there are none: corners
// that are no neighbours in the loop are only joined where `may_join` says so, and no triangle is without area.
//
// `normals` look outwards, the loop runs clockwise around the hole as seen from there; corners of triangles are indices
// into the loop, counter-clockwise. Without normals area alone decides, however the loop is turned.
std::vector<std::array<int32_t, 3>> TriangulateLoop(absl::Span<const Eigen::Vector3d> loop,
                                                    absl::Span<const Eigen::Vector3d> normals,
                                                    const std::function<bool(int32_t, int32_t)>& may_join);

}  // namespace meshwright
