// SPDX-License-Identifier: Apache-2.0
#include "tools/raycast/mesh_ray_caster.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include <Eigen/Geometry>
#include <embree3/rtcore.h>

#include "common/base/check.h"

namespace meshwright {
namespace {

// One device for the process, never released: scenes of static lifetime may outlive any owner.
RTCDevice Device() {
  static RTCDevice device = rtcNewDevice("threads=1,set_affinity=0");
  MW_CHECK(device != nullptr);
  return device;
}

// Nearest point to p on the triangle a, b, c: Voronoi regions of the corners, edges and the face.
Eigen::Vector3d NearestOnTriangle(const Eigen::Vector3d& p, const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                                  const Eigen::Vector3d& c) {
  const Eigen::Vector3d ab = b - a;
  const Eigen::Vector3d ac = c - a;
  const Eigen::Vector3d ap = p - a;
  const double d1 = ab.dot(ap);
  const double d2 = ac.dot(ap);
  if (d1 <= 0 && d2 <= 0) return a;
  const Eigen::Vector3d bp = p - b;
  const double d3 = ab.dot(bp);
  const double d4 = ac.dot(bp);
  if (d3 >= 0 && d4 <= d3) return b;
  const double vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) return a + d1 / (d1 - d3) * ab;
  const Eigen::Vector3d cp = p - c;
  const double d5 = ab.dot(cp);
  const double d6 = ac.dot(cp);
  if (d6 >= 0 && d5 <= d6) return c;
  const double vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) return a + d2 / (d2 - d6) * ac;
  const double va = d3 * d6 - d5 * d4;
  if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) return b + (d4 - d3) / ((d4 - d3) + (d5 - d6)) * (c - b);
  const double sum = va + vb + vc;
  return a + vb / sum * ab + vc / sum * ac;
}

}  // namespace

struct MeshRayCaster::State {
  // Embree reads 16 bytes at every vertex of a shared buffer, so the last one is followed by padding.
  std::vector<Eigen::Vector3f> positions;
  std::vector<std::array<uint32_t, 3>> faces;
  RTCScene scene = nullptr;

  Eigen::Vector3d Corner(int32_t face, size_t corner) const {
    return positions[faces[static_cast<size_t>(face)][corner]].cast<double>();
  }

  // Distance along the ray to the plane of the face; Embree's own where the ray runs within the plane.
  double ExactDistance(int32_t face, const Eigen::Vector3d& origin, const Eigen::Vector3d& direction,
                       double embree_distance) const {
    const Eigen::Vector3d a = Corner(face, 0);
    const Eigen::Vector3d normal = (Corner(face, 1) - a).cross(Corner(face, 2) - a);
    const double distance = normal.dot(a - origin) / normal.dot(direction);
    return std::abs(distance - embree_distance) <= 1e-3 * embree_distance ? distance : embree_distance;
  }
};

namespace {

struct NearestQuery {
  const std::vector<Eigen::Vector3f>* positions;
  const std::vector<std::array<uint32_t, 3>>* faces;
  Eigen::Vector3d x;
  double radius;
  NearestSurfacePoint nearest;
};

bool VisitTriangle(RTCPointQueryFunctionArguments* arguments) {
  auto* query = static_cast<NearestQuery*>(arguments->userPtr);
  const std::array<uint32_t, 3>& face = (*query->faces)[arguments->primID];
  const Eigen::Vector3d nearest =
      NearestOnTriangle(query->x, (*query->positions)[face[0]].cast<double>(),
                        (*query->positions)[face[1]].cast<double>(), (*query->positions)[face[2]].cast<double>());
  const double distance = (nearest - query->x).norm();
  if (!(distance <= query->radius)) return false;
  query->radius = distance;
  query->nearest = {static_cast<int32_t>(arguments->primID), distance};
  // The tree's boxes are in float: look a little further than the nearest so far.
  const float radius = std::nextafter(static_cast<float>(distance * (1 + 1e-6)), INFINITY);
  if (radius >= arguments->query->radius) return false;
  arguments->query->radius = radius;
  return true;
}

}  // namespace

MeshRayCaster::MeshRayCaster(const TriangleMesh& mesh) : state_(std::make_unique<State>()) {
  for (const std::array<uint32_t, 3>& face : mesh.faces) {
    MW_CHECK(*std::max_element(face.begin(), face.end()) < mesh.positions.size());
  }
  state_->positions = mesh.positions;
  state_->positions.emplace_back(Eigen::Vector3f::Zero());
  state_->positions.emplace_back(Eigen::Vector3f::Zero());
  state_->faces = mesh.faces;
  state_->scene = rtcNewScene(Device());
  rtcSetSceneFlags(state_->scene, RTC_SCENE_FLAG_ROBUST);
  rtcSetSceneBuildQuality(state_->scene, RTC_BUILD_QUALITY_MEDIUM);
  if (!state_->faces.empty()) {
    RTCGeometry geometry = rtcNewGeometry(Device(), RTC_GEOMETRY_TYPE_TRIANGLE);
    rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, state_->positions.data(), 0,
                               sizeof(Eigen::Vector3f), mesh.positions.size());
    rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, state_->faces.data(), 0,
                               sizeof(state_->faces[0]), state_->faces.size());
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(state_->scene, geometry);
    rtcReleaseGeometry(geometry);
  }
  rtcCommitScene(state_->scene);
}

MeshRayCaster::~MeshRayCaster() {
  if (state_ != nullptr) rtcReleaseScene(state_->scene);
}
MeshRayCaster::MeshRayCaster(MeshRayCaster&&) noexcept = default;
MeshRayCaster& MeshRayCaster::operator=(MeshRayCaster&& other) noexcept {
  std::swap(state_, other.state_);
  return *this;
}

RayHit MeshRayCaster::Cast(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) const {
  RTCIntersectContext context{};
  rtcInitIntersectContext(&context);
  RTCRayHit query = {};
  query.ray.org_x = static_cast<float>(origin.x());
  query.ray.org_y = static_cast<float>(origin.y());
  query.ray.org_z = static_cast<float>(origin.z());
  query.ray.dir_x = static_cast<float>(direction.x());
  query.ray.dir_y = static_cast<float>(direction.y());
  query.ray.dir_z = static_cast<float>(direction.z());
  query.ray.tfar = std::numeric_limits<float>::infinity();
  query.ray.mask = ~0U;
  query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  query.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
  rtcIntersect1(state_->scene, &context, &query);
  if (query.hit.geomID == RTC_INVALID_GEOMETRY_ID) return {};
  const auto face = static_cast<int32_t>(query.hit.primID);
  return {face, state_->ExactDistance(face, origin, direction, query.ray.tfar), query.hit.u, query.hit.v};
}

std::array<RayHit, 4> MeshRayCaster::Cast4(const Eigen::Vector3d& origin,
                                           const std::array<Eigen::Vector3d, 4>& directions) const {
  RTCIntersectContext context{};
  rtcInitIntersectContext(&context);
  context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
  alignas(16) const int valid[4] = {-1, -1, -1, -1};
  RTCRayHit4 query = {};
  for (size_t i = 0; i < 4; ++i) {
    query.ray.org_x[i] = static_cast<float>(origin.x());
    query.ray.org_y[i] = static_cast<float>(origin.y());
    query.ray.org_z[i] = static_cast<float>(origin.z());
    query.ray.dir_x[i] = static_cast<float>(directions[i].x());
    query.ray.dir_y[i] = static_cast<float>(directions[i].y());
    query.ray.dir_z[i] = static_cast<float>(directions[i].z());
    query.ray.tfar[i] = std::numeric_limits<float>::infinity();
    query.ray.mask[i] = ~0U;
    query.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;
    query.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
  }
  rtcIntersect4(valid, state_->scene, &context, &query);
  std::array<RayHit, 4> hits;
  for (size_t i = 0; i < 4; ++i) {
    if (query.hit.geomID[i] == RTC_INVALID_GEOMETRY_ID) continue;
    const auto face = static_cast<int32_t>(query.hit.primID[i]);
    hits[i] = {face, state_->ExactDistance(face, origin, directions[i], query.ray.tfar[i]), query.hit.u[i],
               query.hit.v[i]};
  }
  return hits;
}

bool MeshRayCaster::IsBlocked(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction, double near,
                              double far) const {
  RTCIntersectContext context{};
  rtcInitIntersectContext(&context);
  RTCRay ray = {};
  ray.org_x = static_cast<float>(origin.x());
  ray.org_y = static_cast<float>(origin.y());
  ray.org_z = static_cast<float>(origin.z());
  ray.dir_x = static_cast<float>(direction.x());
  ray.dir_y = static_cast<float>(direction.y());
  ray.dir_z = static_cast<float>(direction.z());
  ray.tnear = static_cast<float>(near);
  ray.tfar = static_cast<float>(far);
  ray.mask = ~0U;
  rtcOccluded1(state_->scene, &context, &ray);
  return ray.tfar < 0;
}

uint32_t MeshRayCaster::AreBlocked4(const std::array<Eigen::Vector3d, 4>& origins, const Eigen::Vector3d& direction,
                                    double near, uint32_t active) const {
  RTCIntersectContext context{};
  rtcInitIntersectContext(&context);
  context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
  alignas(16) int valid[4];
  RTCRay4 ray = {};
  for (size_t i = 0; i < 4; ++i) {
    valid[i] = ((active >> i) & 1U) != 0 ? -1 : 0;
    ray.org_x[i] = static_cast<float>(origins[i].x());
    ray.org_y[i] = static_cast<float>(origins[i].y());
    ray.org_z[i] = static_cast<float>(origins[i].z());
    ray.dir_x[i] = static_cast<float>(direction.x());
    ray.dir_y[i] = static_cast<float>(direction.y());
    ray.dir_z[i] = static_cast<float>(direction.z());
    ray.tnear[i] = static_cast<float>(near);
    ray.tfar[i] = std::numeric_limits<float>::infinity();
    ray.mask[i] = ~0U;
  }
  rtcOccluded4(valid, state_->scene, &context, &ray);
  uint32_t blocked = 0;
  for (uint32_t i = 0; i < 4; ++i) {
    if (valid[i] != 0 && ray.tfar[i] < 0) blocked |= 1U << i;
  }
  return blocked;
}

NearestSurfacePoint MeshRayCaster::Nearest(const Eigen::Vector3d& x, double radius) const {
  NearestQuery nearest_query{&state_->positions, &state_->faces, x, radius, {}};
  RTCPointQuery query = {};
  query.x = static_cast<float>(x.x());
  query.y = static_cast<float>(x.y());
  query.z = static_cast<float>(x.z());
  // Room for the rounding of the query itself; the exact radius is tested in double.
  const double rounding = 1e-6 * x.cwiseAbs().maxCoeff();
  query.radius = std::nextafter(static_cast<float>(radius * (1 + 1e-6) + rounding), INFINITY);
  RTCPointQueryContext context{};
  rtcInitPointQueryContext(&context);
  rtcPointQuery(state_->scene, &query, &context, VisitTriangle, &nearest_query);
  return nearest_query.nearest;
}

Eigen::Vector3d MeshRayCaster::FaceNormal(int32_t face) const {
  const Eigen::Vector3d a = state_->Corner(face, 0);
  return (state_->Corner(face, 1) - a).cross(state_->Corner(face, 2) - a).stableNormalized();
}

}  // namespace meshwright
