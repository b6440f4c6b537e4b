// SPDX-License-Identifier: Apache-2.0
#include "common/closing/tetrahedra.h"

#include <algorithm>
#include <cstdio>
#include <limits>
#include <memory>
#include <utility>

#include <Eigen/Geometry>
extern "C" {
#include <libqhull_r/qhull_ra.h>
}

#include "common/base/check.h"

namespace meshwright {
namespace {

// Corners of the face opposite to each corner, counter-clockwise seen from it.
constexpr std::array<std::array<size_t, 3>, 4> kFace = {{{1, 3, 2}, {0, 2, 3}, {0, 3, 1}, {0, 1, 2}}};
// A start this far (sine) beyond a face of the tetrahedron is rounding.
constexpr double kSlack = 1e-6;
// Rounding can make a walk go in circles.
constexpr int kMostCrossings = 5000;

struct CloseFile {
  void operator()(std::FILE* file) const { std::fclose(file); }
};

// Owns what Qhull allocates.
class QhullRun {
 public:
  // False: there is no triangulation.
  bool Delaunay(std::vector<double>& coordinates) {
    const std::unique_ptr<std::FILE, CloseFile> messages(std::fopen("/dev/null", "w"));
    MW_CHECK(messages != nullptr);
    // d: Delaunay; Qbb: scaled for it; QJ: joggled, so that all is simplicial; Q12: large facets are no error.
    std::string options = "qhull d Qbb Q12 QJ";
    return qh_new_qhull(&qh_, 3, static_cast<int>(coordinates.size() / 3), coordinates.data(), False, options.data(),
                        nullptr, messages.get()) == 0;
  }
  qhT* get() { return &qh_; }

  QhullRun() { qh_zero(&qh_, stderr); }
  QhullRun(const QhullRun&) = delete;
  QhullRun& operator=(const QhullRun&) = delete;
  ~QhullRun() {
    qh_freeqhull(&qh_, !qh_ALL);
    int still_used = 0;
    int still_used_bytes = 0;
    qh_memfreeshort(&qh_, &still_used, &still_used_bytes);
  }

 private:
  qhT qh_ = {};
};

std::vector<Tetrahedra::Tetrahedron> Triangulate(const std::vector<Eigen::Vector3d>& points) {
  // Fewer have no tetrahedron with a neighbour, and Qhull wants one more than a simplex has.
  if (points.size() < 5) return {};
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& x : points) mean += x / static_cast<double>(points.size());
  std::vector<double> coordinates;
  coordinates.reserve(3 * points.size());
  for (const Eigen::Vector3d& x : points) {
    for (int k = 0; k < 3; ++k) coordinates.push_back(x[k] - mean[k]);
  }
  QhullRun run;
  if (!run.Delaunay(coordinates)) return {};
  qhT* const qh = run.get();  // Qhull's macros ask for this name
  std::vector<int32_t> number(qh->facet_id + 1, Tetrahedra::kNone);
  int32_t count = 0;
  facetT* facet = nullptr;
  FORALLfacets {
    if (!facet->upperdelaunay && facet->simplicial) number[facet->id] = count++;
  }
  std::vector<Tetrahedra::Tetrahedron> tetrahedra;
  tetrahedra.reserve(static_cast<size_t>(count));
  FORALLfacets {
    if (number[facet->id] == Tetrahedra::kNone) continue;
    Tetrahedra::Tetrahedron& added = tetrahedra.emplace_back();
    for (int k = 0; k < 4; ++k) {
      // Of a simplicial facet the k-th neighbour is the one opposite to the k-th vertex.
      const auto* const vertex = SETelemt_(facet->vertices, k, vertexT);
      const auto* const neighbor = SETelemt_(facet->neighbors, k, facetT);
      added.corner[static_cast<size_t>(k)] = qh_pointid(qh, vertex->point);
      added.neighbor[static_cast<size_t>(k)] = number[neighbor->id];
    }
  }
  return tetrahedra;
}

}  // namespace

Tetrahedra::Tetrahedra(std::vector<Eigen::Vector3d> points)
    : points_(std::move(points)), tetrahedra_(Triangulate(points_)), around_(points_.size()) {
  for (size_t t = 0; t < tetrahedra_.size(); ++t) {
    Tetrahedron& tetrahedron = tetrahedra_[t];
    const auto at = [&](size_t k) { return At(tetrahedron.corner[k]); };
    if ((at(1) - at(0)).cross(at(2) - at(0)).dot(at(3) - at(0)) < 0) {
      std::swap(tetrahedron.corner[0], tetrahedron.corner[1]);
      std::swap(tetrahedron.neighbor[0], tetrahedron.neighbor[1]);
    }
    for (const int32_t point : tetrahedron.corner) {
      around_[static_cast<size_t>(point)].push_back(static_cast<int32_t>(t));
    }
  }
}

std::array<int32_t, 3> Tetrahedra::Face(int32_t tetrahedron, int face) const {
  const std::array<int32_t, 4>& corner = tetrahedra_[static_cast<size_t>(tetrahedron)].corner;
  const std::array<size_t, 3>& of = kFace[static_cast<size_t>(face)];
  return {corner[of[0]], corner[of[1]], corner[of[2]]};
}

int Tetrahedra::FaceTowards(int32_t tetrahedron, int32_t neighbor) const {
  const std::array<int32_t, 4>& behind = tetrahedra_[static_cast<size_t>(tetrahedron)].neighbor;
  const auto found = std::ranges::find(behind, neighbor);
  MW_CHECK(found != behind.end());
  return static_cast<int>(found - behind.begin());
}

Eigen::Vector3d Tetrahedra::Circumcenter(int32_t tetrahedron) const {
  const std::array<int32_t, 4>& corner = tetrahedra_[static_cast<size_t>(tetrahedron)].corner;
  const Eigen::Vector3d a = At(corner[0]);
  const Eigen::Vector3d b = At(corner[1]) - a;
  const Eigen::Vector3d c = At(corner[2]) - a;
  const Eigen::Vector3d d = At(corner[3]) - a;
  const double volume = b.dot(c.cross(d));
  if (!(volume > std::numeric_limits<double>::min())) return a;
  return a +
         (d.squaredNorm() * b.cross(c) + c.squaredNorm() * d.cross(b) + b.squaredNorm() * c.cross(d)) / (2 * volume);
}

Eigen::Vector3d Tetrahedra::InwardNormal(int32_t tetrahedron, int face) const {
  const std::array<int32_t, 3> corners = Face(tetrahedron, face);
  const Eigen::Vector3d& a = At(corners[0]);
  return (At(corners[1]) - a).cross(At(corners[2]) - a);
}

int32_t Tetrahedra::StartOf(int32_t point, const Eigen::Vector3d& direction) const {
  int32_t best = kNone;
  double best_sine = -kSlack;
  for (const int32_t t : Around(point)) {
    double sine = std::numeric_limits<double>::infinity();
    for (int face = 0; face < 4; ++face) {
      if (tetrahedra_[static_cast<size_t>(t)].corner[static_cast<size_t>(face)] == point) continue;
      const Eigen::Vector3d normal = InwardNormal(t, face);
      const double length = normal.norm();
      if (length > 0) sine = std::min(sine, normal.dot(direction) / length);
    }
    if (sine > best_sine) {
      best_sine = sine;
      best = t;
    }
  }
  return best;
}

int32_t Tetrahedra::Walk(int32_t point, const Eigen::Vector3d& direction,
                         const std::function<bool(const Crossing&)>& visit) const {
  const int32_t start = StartOf(point, direction);
  int32_t at = start;
  int entry = -1;
  for (int crossings = 0; at != kNone && crossings < kMostCrossings; ++crossings) {
    Crossing crossing = {.from = at, .face = -1, .distance = std::numeric_limits<double>::infinity()};
    for (int face = 0; face < 4; ++face) {
      // In the first one only the face opposite to the point can be met.
      const bool may_be =
          entry < 0 ? tetrahedra_[static_cast<size_t>(at)].corner[static_cast<size_t>(face)] == point : face != entry;
      if (!may_be) continue;
      const Eigen::Vector3d normal = InwardNormal(at, face);
      const double slope = normal.dot(direction);
      if (slope >= 0) continue;
      const double distance = normal.dot(At(Face(at, face)[0]) - At(point)) / slope;
      if (distance < crossing.distance) {
        crossing.distance = distance;
        crossing.face = face;
      }
    }
    if (crossing.face < 0) break;
    crossing.to = tetrahedra_[static_cast<size_t>(at)].neighbor[static_cast<size_t>(crossing.face)];
    if (!visit(crossing) || crossing.to == kNone) break;
    entry = FaceTowards(crossing.to, at);
    at = crossing.to;
  }
  return start;
}

}  // namespace meshwright
