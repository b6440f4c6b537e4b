// SPDX-License-Identifier: Apache-2.0
#include "pipeline/texturing/seam_leveling.h"

#include <algorithm>
#include <array>

#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>

#include "pipeline/texturing/label_solver.h"

#include "common/base/check.h"

namespace meshwright {
namespace {

constexpr double kSmoothness = 10;  // 1 / lambda: weight of a difference within a chart against one across a seam
// Gaps beyond this count less and less: something else than exposure is behind them, as reflections and silhouettes.
constexpr double kGapScale = 12;    // grey levels
constexpr float kMostHalfGap = 20;  // grey levels that are closed pixel by pixel, to each side
constexpr double kAnchor = 1e-5;    // weight of an offset itself: the mean of a surface stays

// A system of normal equations as they are added up.
class Equations {
 public:
  explicit Equations(size_t unknowns)
      : unknowns_(static_cast<Eigen::Index>(unknowns)), right_(Eigen::MatrixX3d::Zero(unknowns_, 3)) {}

  // weight (x_a - x_b - difference)^2
  void AddDifference(size_t a, size_t b, double weight, const Eigen::Vector3d& difference) {
    const auto row = static_cast<int>(a);
    const auto column = static_cast<int>(b);
    entries_.emplace_back(row, row, weight);
    entries_.emplace_back(column, column, weight);
    entries_.emplace_back(row, column, -weight);
    entries_.emplace_back(column, row, -weight);
    right_.row(row) += weight * difference.transpose();
    right_.row(column) -= weight * difference.transpose();
  }

  // By factors: the graph is that of a surface, so they have some dozens of entries a row, and conjugate gradients take
  // hundreds of steps where charts are wide.
  Eigen::MatrixX3d Solve() {
    for (Eigen::Index i = 0; i < unknowns_; ++i) {
      entries_.emplace_back(static_cast<int>(i), static_cast<int>(i), kAnchor);
    }
    Eigen::SparseMatrix<double> matrix(unknowns_, unknowns_);
    matrix.setFromTriplets(entries_.begin(), entries_.end());
    entries_ = {};
    const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> factors(matrix);
    MW_CHECK(factors.info() == Eigen::Success);  // the anchor makes it positive definite
    return factors.solve(right_);
  }

 private:
  const Eigen::Index unknowns_;
  std::vector<Eigen::Triplet<double>> entries_;
  Eigen::MatrixX3d right_;
};

// Colours at one end of a seam: samples count less the farther they are from it, none at the other end.
Eigen::Vector3d GapAt(const Seams& seams, const Seam& seam, size_t end) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  double weights = 0;
  for (int i = 0; i < seam.samples; ++i) {
    const double place = Seams::Place(seam, i);
    const double weight = end == 0 ? 1 - place : place;
    sum += weight * (seams.Color(seam, 1, i) - seams.Color(seam, 0, i)).cast<double>();
    weights += weight;
  }
  return sum / weights;
}

// By how much side 1 is brighter than side 0 at a sample.
Eigen::Vector3f Gap(const Seams& seams, const Seam& seam, int sample, const VertexOffsets& offsets) {
  const auto place = static_cast<float>(Seams::Place(seam, sample));
  const auto color = [&](size_t side) -> Eigen::Vector3f {
    return seams.Color(seam, side, sample) + (1 - place) * offsets.At(seam.vertices[0], seam.labels[side]) +
           place * offsets.At(seam.vertices[1], seam.labels[side]);
  };
  return color(1) - color(0);
}

}  // namespace

VertexOffsets::VertexOffsets(const TriangleMesh& mesh, const std::vector<int32_t>& labels)
    : first_(mesh.positions.size() + 1, 0) {
  std::vector<std::pair<uint32_t, int32_t>> pairs;
  for (size_t f = 0; f < labels.size(); ++f) {
    if (labels[f] == kNoLabel) continue;
    for (const uint32_t v : mesh.faces[f]) pairs.emplace_back(v, labels[f]);
  }
  std::ranges::sort(pairs);
  pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
  labels_.reserve(pairs.size());
  for (const auto& [vertex, label] : pairs) {
    ++first_[vertex + 1];
    labels_.push_back(label);
  }
  for (size_t v = 1; v < first_.size(); ++v) first_[v] += first_[v - 1];
  offsets_.assign(labels_.size(), Eigen::Vector3f::Zero());
}

size_t VertexOffsets::Find(uint32_t vertex, int32_t label) const {
  for (size_t i = first_[vertex]; i < first_[vertex + 1]; ++i) {
    if (labels_[i] == label) return i;
  }
  MW_CHECK(false);
  return 0;
}

int32_t VertexOffsets::FirstLabel(uint32_t vertex) const {
  return first_[vertex] < first_[vertex + 1] ? labels_[first_[vertex]] : kNoLabel;
}

void LevelSeams(const TriangleMesh& mesh, const std::vector<int32_t>& labels, const Seams& seams,
                VertexOffsets& offsets) {
  if (seams.all().empty()) return;
  Equations equations(offsets.size());
  for (size_t f = 0; f < labels.size(); ++f) {
    if (labels[f] == kNoLabel) continue;
    for (size_t k = 0; k < 3; ++k) {
      equations.AddDifference(offsets.Find(mesh.faces[f][k], labels[f]),
                              offsets.Find(mesh.faces[f][(k + 1) % 3], labels[f]), kSmoothness,
                              Eigen::Vector3d::Zero());
    }
  }
  for (const Seam& seam : seams.all()) {
    for (size_t end = 0; end < 2; ++end) {
      const Eigen::Vector3d gap = GapAt(seams, seam, end);
      const double weight = 1 / (1 + gap.squaredNorm() / (3 * kGapScale * kGapScale));
      equations.AddDifference(offsets.Find(seam.vertices[end], seam.labels[0]),
                              offsets.Find(seam.vertices[end], seam.labels[1]), weight, gap);
    }
  }
  const Eigen::MatrixX3d solution = equations.Solve();
  for (size_t i = 0; i < offsets.size(); ++i) {
    offsets[i] = solution.row(static_cast<Eigen::Index>(i)).transpose().cast<float>();
  }
}

Eigen::Vector3f HalfGap(const Seams& seams, const Seam& seam, int sample, const VertexOffsets& offsets) {
  return (0.5F * Gap(seams, seam, sample, offsets)).cwiseMax(-kMostHalfGap).cwiseMin(kMostHalfGap);
}

SeamJumps MeasureJumps(const Seams& seams, const VertexOffsets& offsets) {
  SeamJumps jumps;
  double samples = 0;
  for (const Seam& seam : seams.all()) {
    for (int i = 0; i < seam.samples; ++i) {
      jumps.as_photographed += (seams.Color(seam, 1, i) - seams.Color(seam, 0, i)).cwiseAbs().mean();
      jumps.leveled += Gap(seams, seam, i, offsets).cwiseAbs().mean();
      samples += 1;
    }
  }
  if (samples > 0) {
    jumps.as_photographed /= samples;
    jumps.leveled /= samples;
  }
  return jumps;
}

}  // namespace meshwright
