// SPDX-License-Identifier: Apache-2.0
#include "common/mesh/loop_triangulation.h"

#include <algorithm>
#include <limits>

#include <Eigen/Geometry>

#include "common/base/check.h"

namespace meshwright {
namespace {

// Of the triangles of a part of the loop. The lesser is the better.
struct Weight {
  double turn = 0;  // of the worst: 1 - cosine between its normal and the one of its corners' that it lies worst with
  double area = 0;

  friend bool operator<(const Weight& a, const Weight& b) {
    return a.turn < b.turn || (a.turn == b.turn && a.area < b.area);
  }
};

constexpr double kNever = std::numeric_limits<double>::infinity();

class LoopTriangulation {
 public:
  LoopTriangulation(absl::Span<const Eigen::Vector3d> loop, absl::Span<const Eigen::Vector3d> normals,
                    const std::function<bool(int32_t, int32_t)>& may_join)
      : loop_(loop), normals_(normals), may_join_(may_join), count_(static_cast<int32_t>(loop.size())) {
    best_.resize(loop.size() * loop.size());
    apex_.assign(loop.size() * loop.size(), -1);
  }

  std::vector<std::array<int32_t, 3>> Run() {
    for (int32_t span = 2; span < count_; ++span) {
      for (int32_t from = 0; from + span < count_; ++from) Choose(from, from + span);
    }
    std::vector<std::array<int32_t, 3>> triangles;
    if (best_[At(0, count_ - 1)].turn < kNever) Collect(0, count_ - 1, triangles);
    return triangles;
  }

 private:
  size_t At(int32_t from, int32_t to) const {
    return static_cast<size_t>(from) * loop_.size() + static_cast<size_t>(to);
  }

  // The loop's part from `from` to `to`, closed by the edge between them.
  void Choose(int32_t from, int32_t to) {
    Weight& best = best_[At(from, to)];
    best = {kNever, kNever};
    if (to - from < count_ - 1 && !may_join_(from, to)) return;
    for (int32_t apex = from + 1; apex < to; ++apex) {
      const Weight& before = best_[At(from, apex)];
      const Weight& behind = best_[At(apex, to)];
      if (before.turn == kNever || behind.turn == kNever) continue;
      const Weight own = WeightOf(to, apex, from);
      const Weight all = {std::max({own.turn, before.turn, behind.turn}), own.area + before.area + behind.area};
      if (!(all < best)) continue;
      best = all;
      apex_[At(from, to)] = apex;
    }
  }

  Weight WeightOf(int32_t a, int32_t b, int32_t c) const {
    const auto at = [](const auto& values, int32_t i) -> const Eigen::Vector3d& {
      return values[static_cast<size_t>(i)];
    };
    const Eigen::Vector3d cross = (at(loop_, b) - at(loop_, a)).cross(at(loop_, c) - at(loop_, a));
    const double length = cross.norm();
    if (!(length > 0)) return {kNever, kNever};
    double cosine = 1;
    if (!normals_.empty()) {
      for (const int32_t i : {a, b, c}) cosine = std::min(cosine, cross.dot(at(normals_, i)) / length);
    }
    return {1 - cosine, 0.5 * length};
  }

  void Collect(int32_t from, int32_t to, std::vector<std::array<int32_t, 3>>& triangles) const {
    if (to - from < 2) return;
    const int32_t apex = apex_[At(from, to)];
    triangles.push_back({to, apex, from});
    Collect(from, apex, triangles);
    Collect(apex, to, triangles);
  }

  absl::Span<const Eigen::Vector3d> loop_;
  absl::Span<const Eigen::Vector3d> normals_;
  const std::function<bool(int32_t, int32_t)>& may_join_;
  const int32_t count_;
  std::vector<Weight> best_;  // by first and last corner; nothing to do between neighbours
  std::vector<int32_t> apex_;
};

}  // namespace

std::vector<std::array<int32_t, 3>> TriangulateLoop(absl::Span<const Eigen::Vector3d> loop,
                                                    absl::Span<const Eigen::Vector3d> normals,
                                                    const std::function<bool(int32_t, int32_t)>& may_join) {
  MW_CHECK(loop.size() >= 3 && (normals.empty() || normals.size() == loop.size()));
  return LoopTriangulation(loop, normals, may_join).Run();
}

}  // namespace meshwright
