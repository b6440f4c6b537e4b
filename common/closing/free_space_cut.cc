// SPDX-License-Identifier: Apache-2.0
#include "common/closing/free_space_cut.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <random>

#include <Eigen/Geometry>
#include <boost/graph/adjacency_list.hpp>
#include <boost/graph/boykov_kolmogorov_max_flow.hpp>

#include "common/closing/tetrahedra.h"

namespace meshwright {
namespace {

// What one sight costs.
constexpr int kUnit = 256;
constexpr int kUncuttable = 1 << 30;
// Points of a plane move by so many spacings out of it, so that the flat tetrahedra between them have an inside.
constexpr double kJoggle = 0.02;
// The corners of a box so many times as large as all that is there lie around it.
constexpr double kFarAway = 2;
// What it costs to leave space open to the outside: next to nothing, but surface is not left away for nothing.
constexpr int kOutside = kUnit / 16;
// A sight counts less the closer to its point: 1 - exp(-(d / s)^2 / 2), s in spacings.
constexpr double kSoftness = 3;
// What so many spacings behind a point is solid.
constexpr double kSolidBehind = 3;

using Traits = boost::adjacency_list_traits<boost::vecS, boost::vecS, boost::directedS>;
using Graph = boost::adjacency_list<
    boost::vecS, boost::vecS, boost::directedS,
    boost::property<
        boost::vertex_index_t, std::size_t,
        boost::property<boost::vertex_color_t, boost::default_color_type,
                        boost::property<boost::vertex_distance_t, int,
                                        boost::property<boost::vertex_predecessor_t, Traits::edge_descriptor>>>>,
    boost::property<boost::edge_capacity_t, int,
                    boost::property<boost::edge_residual_capacity_t, int,
                                    boost::property<boost::edge_reverse_t, Traits::edge_descriptor>>>>;

class Cut {
 public:
  Cut(absl::Span<const MeasuredPoint> points, absl::Span<const Eigen::Vector3d> centers)
      : points_(points),
        tetrahedra_(WithSurroundings(points, centers)),
        seen_through_(tetrahedra_.all().size(), {0, 0, 0, 0}),
        solid_(tetrahedra_.all().size(), 0),
        has_camera_(tetrahedra_.all().size(), 0) {
    for (size_t camera = 0; camera < centers.size(); ++camera) {
      for (const int32_t t : tetrahedra_.Around(PointOfCamera(static_cast<int32_t>(camera)))) {
        has_camera_[static_cast<size_t>(t)] = 1;
      }
    }
  }

  void Look(const Sight& sight) {
    const MeasuredPoint& point = points_[static_cast<size_t>(sight.point)];
    const int32_t camera = PointOfCamera(sight.camera);
    const Eigen::Vector3d to_camera = tetrahedra_.points()[static_cast<size_t>(camera)] - point.x_in_world;
    const double camera_distance = to_camera.norm();
    if (!(camera_distance > 0)) return;
    const Eigen::Vector3d direction = to_camera / camera_distance;
    tetrahedra_.Walk(sight.point, direction, [&](const Tetrahedra::Crossing& crossing) {
      if (HasCorner(crossing.from, camera) || crossing.distance > camera_distance || crossing.to == Tetrahedra::kNone) {
        return false;
      }
      const double steps = crossing.distance / (kSoftness * point.spacing);
      const auto face = static_cast<size_t>(tetrahedra_.FaceTowards(crossing.to, crossing.from));
      seen_through_[static_cast<size_t>(crossing.to)][face] +=
          static_cast<int>(std::lround(kUnit * (1 - std::exp(-0.5 * steps * steps))));
      return true;
    });
    int32_t behind = Tetrahedra::kNone;
    const int32_t first = tetrahedra_.Walk(sight.point, -direction, [&](const Tetrahedra::Crossing& crossing) {
      behind = crossing.from;
      if (crossing.distance >= kSolidBehind * point.spacing || crossing.to == Tetrahedra::kNone) return false;
      behind = crossing.to;
      return true;
    });
    if (first != Tetrahedra::kNone) solid_[static_cast<size_t>(behind == Tetrahedra::kNone ? first : behind)] += kUnit;
  }

  std::vector<std::array<int32_t, 3>> Triangles() {
    const std::vector<uint8_t> is_empty = MinimumCut();
    std::vector<std::array<int32_t, 3>> triangles;
    for (size_t t = 0; t < is_empty.size(); ++t) {
      if (is_empty[t] == 0) continue;
      for (int face = 0; face < 4; ++face) {
        const int32_t behind = tetrahedra_.all()[t].neighbor[static_cast<size_t>(face)];
        if (behind != Tetrahedra::kNone && is_empty[static_cast<size_t>(behind)] != 0) continue;
        const std::array<int32_t, 3> corners = tetrahedra_.Face(static_cast<int32_t>(t), face);
        const bool is_measured =
            std::ranges::all_of(corners, [&](int32_t p) { return p < static_cast<int32_t>(points_.size()); });
        if (is_measured) triangles.push_back(corners);
      }
    }
    return triangles;
  }

 private:
  static std::vector<Eigen::Vector3d> WithSurroundings(absl::Span<const MeasuredPoint> points,
                                                       absl::Span<const Eigen::Vector3d> centers) {
    std::vector<Eigen::Vector3d> all;
    all.reserve(points.size() + centers.size());
    std::mt19937 random;  // the same sequence everywhere, unlike the standard's distributions
    const auto unit = [&] { return static_cast<double>(random()) / static_cast<double>(std::mt19937::max()) - 0.5; };
    for (const MeasuredPoint& point : points) {
      const double x = unit();
      const double y = unit();
      const double z = unit();
      all.push_back(point.x_in_world + kJoggle * point.spacing * Eigen::Vector3d(x, y, z));
    }
    all.insert(all.end(), centers.begin(), centers.end());
    // Something lies behind every surface.
    Eigen::AlignedBox3d box;
    for (const Eigen::Vector3d& x : all) box.extend(x);
    if (!box.isEmpty()) {
      const double far = kFarAway * box.diagonal().norm();
      for (const double x : {-far, far}) {
        for (const double y : {-far, far}) {
          for (const double z : {-far, far}) all.push_back(box.center() + Eigen::Vector3d(x, y, z));
        }
      }
    }
    return all;
  }

  int32_t PointOfCamera(int32_t camera) const { return static_cast<int32_t>(points_.size()) + camera; }

  bool HasCorner(int32_t t, int32_t point) const {
    const std::array<int32_t, 4>& corner = tetrahedra_.all()[static_cast<size_t>(t)].corner;
    return std::ranges::find(corner, point) != corner.end();
  }

  // 1 less the cosine between the triangle and the worse of the two spheres (Labatut et al. 2009), 0 .. 2, halved.
  int CostOfShape(int32_t t, int face, int32_t neighbor) const {
    const std::array<int32_t, 3> corners = tetrahedra_.Face(t, face);
    const auto at = [&](size_t k) { return tetrahedra_.points()[static_cast<size_t>(corners[k])]; };
    const Eigen::Vector3d normal = (at(1) - at(0)).cross(at(2) - at(0)).normalized();  // into t
    const auto cosine = [&](int32_t of, double sign) {
      const Eigen::Vector3d to_center = centers_[static_cast<size_t>(of)] - at(0);
      const double radius = to_center.norm();
      return radius > 0 ? std::clamp(sign * normal.dot(to_center) / radius, -1.0, 1.0) : 0.0;
    };
    return static_cast<int>(std::lround(0.5 * kUnit * (1 - std::min(cosine(t, 1), cosine(neighbor, -1)))));
  }

  std::vector<uint8_t> MinimumCut() {
    const size_t count = tetrahedra_.all().size();
    centers_.clear();
    for (size_t t = 0; t < count; ++t) centers_.push_back(tetrahedra_.Circumcenter(static_cast<int32_t>(t)));
    Graph graph(count + 2);
    const size_t source = count;  // empty
    const size_t sink = count + 1;
    const auto capacity = boost::get(boost::edge_capacity, graph);
    const auto reverse = boost::get(boost::edge_reverse, graph);
    const auto connect = [&](size_t from, size_t to, int there, int back) {
      const Traits::edge_descriptor forth = boost::add_edge(from, to, graph).first;
      const Traits::edge_descriptor opposite = boost::add_edge(to, from, graph).first;
      capacity[forth] = there;
      capacity[opposite] = back;
      reverse[forth] = opposite;
      reverse[opposite] = forth;
    };
    for (size_t t = 0; t < count; ++t) {
      int solid = solid_[t];
      for (int face = 0; face < 4; ++face) {
        const int32_t neighbor = tetrahedra_.all()[t].neighbor[static_cast<size_t>(face)];
        if (neighbor == Tetrahedra::kNone) solid += kOutside;
        if (neighbor <= static_cast<int32_t>(t)) continue;
        const auto back = static_cast<size_t>(tetrahedra_.FaceTowards(neighbor, static_cast<int32_t>(t)));
        const int shape = CostOfShape(static_cast<int32_t>(t), face, neighbor);
        connect(t, static_cast<size_t>(neighbor), seen_through_[t][static_cast<size_t>(face)] + shape,
                seen_through_[static_cast<size_t>(neighbor)][back] + shape);
      }
      if (has_camera_[t] != 0) connect(source, t, kUncuttable, 0);
      if (solid > 0) connect(t, sink, solid, 0);
    }
    boost::boykov_kolmogorov_max_flow(graph, source, sink);
    const auto color = boost::get(boost::vertex_color, graph);
    std::vector<uint8_t> is_empty(count);
    for (size_t t = 0; t < count; ++t) is_empty[t] = color[t] == color[source] ? 1 : 0;
    return is_empty;
  }

  const absl::Span<const MeasuredPoint> points_;
  const Tetrahedra tetrahedra_;
  // Per tetrahedron and face: what it costs when this one is empty and the one behind is not, but for its shape.
  std::vector<std::array<int, 4>> seen_through_;
  std::vector<int> solid_;
  std::vector<uint8_t> has_camera_;
  std::vector<Eigen::Vector3d> centers_;  // of the spheres
};

}  // namespace

std::vector<std::array<int32_t, 3>> CutFreeSpace(absl::Span<const MeasuredPoint> points,
                                                 absl::Span<const Eigen::Vector3d> camera_centers_in_world,
                                                 absl::Span<const Sight> sights) {
  Cut cut(points, camera_centers_in_world);
  for (const Sight& sight : sights) cut.Look(sight);
  return cut.Triangles();
}

}  // namespace meshwright
