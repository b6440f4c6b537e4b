// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "pipeline/texturing/seams.h"

#include "common/mesh/triangle_mesh.h"

namespace meshwright {

// What is added to a photograph's colour at a vertex, for each photograph that one of the vertex's faces has.
class VertexOffsets {
 public:
  VertexOffsets(const TriangleMesh& mesh, const std::vector<int32_t>& labels);

  size_t size() const { return labels_.size(); }
  // Position of the pair among all; it must be there.
  size_t Find(uint32_t vertex, int32_t label) const;
  // The first label of a vertex; kNoLabel when it has none.
  int32_t FirstLabel(uint32_t vertex) const;

  const Eigen::Vector3f& At(uint32_t vertex, int32_t label) const { return offsets_[Find(vertex, label)]; }
  Eigen::Vector3f& operator[](size_t pair) { return offsets_[pair]; }

 private:
  std::vector<size_t> first_;    // of vertex i: pairs first_[i] .. first_[i + 1] - 1
  std::vector<int32_t> labels_;  // ascending at a vertex
  std::vector<Eigen::Vector3f> offsets_;
};

// Offsets that make photographs agree along seams and change slowly within charts: least squares after Lempitsky and
// Ivanov (2007), as in section 4.3 of Waechter et al. 2014, in grey levels. By Cholesky
// factors, for which some kB for each face of the mesh are taken meanwhile.
void LevelSeams(const TriangleMesh& mesh, const std::vector<int32_t>& labels, const Seams& seams,
                VertexOffsets& offsets);

// Mean difference across seams, grey levels (mean of the channels), with and without offsets.
struct SeamJumps {
  double as_photographed = 0;
  double leveled = 0;
};
SeamJumps MeasureJumps(const Seams& seams, const VertexOffsets& offsets);

// What closes the rest of the gap at a sample when it is added to side 0 and taken from side 1; limited, as what is far
// apart is not the same surface.
Eigen::Vector3f HalfGap(const Seams& seams, const Seam& seam, int sample, const VertexOffsets& offsets);

}  // namespace meshwright
