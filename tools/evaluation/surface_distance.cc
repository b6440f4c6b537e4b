// SPDX-License-Identifier: Apache-2.0
#include "tools/evaluation/surface_distance.h"

#include <cmath>
#include <limits>
#include <vector>

#include <nanoflann.hpp>

namespace meshwright {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// Points as nanoflann asks for them.
struct CloudView {
  const std::vector<Eigen::Vector3f>& points;

  size_t kdtree_get_point_count() const { return points.size(); }
  double kdtree_get_pt(size_t i, size_t dimension) const {
    return static_cast<double>(points[i][static_cast<Eigen::Index>(dimension)]);
  }
  template <class Box>
  bool kdtree_get_bbox(Box& /*box*/) const {
    return false;
  }
};

using KdTree = nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<double, CloudView>, CloudView, 3>;

// The nearest point within a radius: nanoflann's own sets of one start with an infinite radius.
class NearestWithin {
 public:
  using DistanceType = double;
  explicit NearestWithin(double squared_radius) : squared_(squared_radius) {}

  bool addPoint(double squared_distance, uint32_t /*index*/) {
    if (squared_distance <= squared_) {
      squared_ = squared_distance;
      found_ = true;
    }
    return true;
  }
  double worstDist() const { return squared_; }
  bool full() const { return true; }
  size_t size() const { return found_ ? 1 : 0; }

  double Distance() const { return found_ ? std::sqrt(squared_) : kInfinity; }

 private:
  double squared_;
  bool found_ = false;
};

}  // namespace

struct PointCloudDistance::Tree {
  explicit Tree(const std::vector<Eigen::Vector3f>& points) : cloud{points}, index(3, cloud, {16}) {
    if (!points.empty()) index.buildIndex();
  }
  CloudView cloud;
  KdTree index;
};

PointCloudDistance::PointCloudDistance(const std::vector<Eigen::Vector3f>& cloud)
    : tree_(std::make_unique<Tree>(cloud)) {}
PointCloudDistance::~PointCloudDistance() = default;

double PointCloudDistance::Within(const Eigen::Vector3d& x, double radius) const {
  if (tree_->cloud.points.empty()) return kInfinity;
  // findNeighbors multiplies bounds: an infinite one would make NaN.
  NearestWithin nearest(std::min(radius * radius, std::numeric_limits<double>::max()));
  tree_->index.findNeighbors(nearest, x.data(), nanoflann::SearchParams());
  return nearest.Distance();
}

SurfaceDistance::SurfaceDistance(const TriangleMesh& mesh, const MeshRayCaster& caster)
    : caster_(caster), cloud_(mesh.faces.empty() ? std::make_unique<PointCloudDistance>(mesh.positions) : nullptr) {}

double SurfaceDistance::Within(const Eigen::Vector3d& x, double radius) const {
  return cloud_ != nullptr ? cloud_->Within(x, radius) : caster_.Nearest(x, radius).distance;
}

}  // namespace meshwright
