// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <absl/status/statusor.h>
#include <absl/types/span.h>

#include "common/base/ids.h"
#include "common/base/spooled_vector.h"
#include "common/base/thread_pool.h"
#include "common/mesh/border_stitching.h"
#include "common/mesh/join_progress.h"
#include "common/mesh/load_surface.h"
#include "common/mesh/surface_overlap.h"
#include "common/surface/sparse_surface.h"

namespace meshwright {

struct BorderOrigin {
  int32_t vertex = 0;     // of its part
  int32_t patch = 0;      // of its surface
  int32_t component = 0;  // of all parts
  std::array<uint8_t, 3> color = {};
};

// A vertex inside a part, one for some 8 x 8 steps of its lattice.
struct InnerSample {
  Eigen::Vector3f position;  // scene units, world frame
  float spacing = 0;         // as of border vertices
  int32_t component = 0;     // of all parts
};

// What is kept of every part while all are joined: where it is trimmed, its border, and what lies inside in outline.
// What grows with the mesh is spooled.
struct PartBorders {
  struct Part {
    int64_t first_patch = 0;      // of `trimmed`
    int32_t first_border = 0;     // of its vertices below
    int32_t first_inner = 0;      // of its samples
    int32_t first_component = 0;  // of its components
    CameraIndex camera_index = 0;
    MeasuredSpace space = {};
  };
  explicit PartBorders(const std::string& spool_beside);

  // The part whose border has the vertex.
  size_t PartOf(int32_t border_vertex) const;
  absl::Span<const uint8_t> Trimmed(size_t part) const;
  void Release() const;

  std::string spool_beside;
  std::vector<Part> parts;         // and one more, which holds the ends
  SpooledVector<uint8_t> trimmed;  // per patch
  SpooledVector<BorderVertex> vertices;
  SpooledVector<BorderOrigin> origins;
  SpooledVector<InnerSample> inner;
  SpooledVector<std::pair<int32_t, int32_t>> inner_edges;  // as BorderStitcher wants them
  std::vector<int64_t> faces_of_component;
};

// Trims accepted surfaces 0 .. count - 1 where an earlier one shows the same and finds the borders of what is left,
// which are spooled beside `spool_beside` (SpooledBytes). Errors: those of `load`.
absl::StatusOr<PartBorders> FindPartBorders(int64_t count, const LoadSurface& load, const std::string& spool_beside,
                                            ThreadPool& pool, JoinProgress& progress);

// Calls body(i) for first .. last - 1 on all threads. The error of the lowest i, once all are done.
absl::Status ForEachPart(int64_t first, int64_t last, ThreadPool& pool,
                         const std::function<absl::Status(int64_t i)>& body);

// Consecutive ranges [first, second) of parts small enough to be worked on at the same time, of `patches` each.
std::vector<std::pair<int64_t, int64_t>> BatchesOfParts(const std::vector<int64_t>& patches);

}  // namespace meshwright
