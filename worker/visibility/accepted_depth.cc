// SPDX-License-Identifier: Apache-2.0
#include "worker/visibility/accepted_depth.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>

#include <Eigen/Core>

#include "common/surface/triangulation.h"

namespace meshwright {
namespace {

// Lattice coordinates are rounded to 1 / kSubSteps of a step, so that edge functions are exact integers: neighbouring
// triangles leave no gap between them, whatever the machine.
constexpr int kSubStepBits = 10;
constexpr int64_t kSubSteps = int64_t{1} << kSubStepBits;
// Corners further out than this (in steps) belong to triangles next to the camera's plane; the limit keeps the edge
// functions within 64 bits.
constexpr double kMaxCoordinate = 1 << 18;
constexpr int64_t kPatchesAtOnce = 8192;

// A patch of the accepted surface as the reference camera sees it.
struct Vertex {
  int32_t u = 0;            // lattice column, 1 / kSubSteps
  int32_t v = 0;            // lattice row, 1 / kSubSteps
  float inverse_depth = 0;  // 0: not in front of the camera
  float quality = 0;
};

// As AcceptedDepthBuffer says.
using Key = uint64_t;
constexpr Key kNothing = ~Key{0};

// Order-preserving map from floats to integers.
uint32_t OrderedBits(float value) {
  const auto bits = std::bit_cast<uint32_t>(value);
  return (bits & 0x80000000U) != 0 ? ~bits : bits | 0x80000000U;
}

float FromOrderedBits(uint32_t ordered) {
  return std::bit_cast<float>((ordered & 0x80000000U) != 0 ? ordered & 0x7FFFFFFFU : ~ordered);
}

Key MakeKey(float depth, float quality) { return Key{OrderedBits(depth)} << 32 | Key{~OrderedBits(quality)}; }
float DepthOf(Key key) { return FromOrderedBits(static_cast<uint32_t>(key >> 32)); }
float QualityOf(Key key) { return FromOrderedBits(~static_cast<uint32_t>(key)); }

void KeepLess(Key& place, Key key) {
  const std::atomic_ref<Key> atomic(place);
  Key current = atomic.load(std::memory_order_relaxed);
  while (key < current && !atomic.compare_exchange_weak(current, key, std::memory_order_relaxed)) {
  }
}

std::vector<Vertex> ProjectPatches(const SparseSurface& accepted, const Camera& reference, const Lattice& lattice,
                                   ThreadPool& pool) {
  const Rigid3 ref_from_cam = reference.cam_from_world * Inverse(accepted.camera.cam_from_world);
  std::vector<Vertex> vertices(accepted.patches());
  pool.ParallelFor(static_cast<int64_t>(vertices.size()), kPatchesAtOnce, [&](int64_t begin, int64_t end) {
    for (auto patch = static_cast<size_t>(begin); patch < static_cast<size_t>(end); ++patch) {
      const Eigen::Vector2d pixel = accepted.lattice.Pixel(accepted.Column(patch), accepted.Row(patch));
      const Eigen::Vector3d x_in_ref = ref_from_cam * Eigen::Vector3d(double{accepted.depth[patch]} *
                                                                      accepted.camera.RayInCam(pixel.x(), pixel.y()));
      if (x_in_ref.z() <= 0) continue;
      const Eigen::Vector2d place = lattice.FromPixel(reference.ProjectFromCam(x_in_ref));
      // Written so that NaN fails it.
      if (!(std::abs(place.x()) < kMaxCoordinate && std::abs(place.y()) < kMaxCoordinate)) continue;
      const auto inverse_depth = static_cast<float>(1 / x_in_ref.z());
      if (!std::isfinite(inverse_depth)) continue;
      vertices[patch] = {static_cast<int32_t>(std::floor(place.x() * kSubSteps + 0.5)),
                         static_cast<int32_t>(std::floor(place.y() * kSubSteps + 0.5)), inverse_depth,
                         accepted.quality[patch]};
    }
  });
  return vertices;
}

// False only if no triangle of these vertices has a node of the lattice in it.
bool MayShow(const std::vector<Vertex>& vertices, const Lattice& lattice) {
  Vertex low = {std::numeric_limits<int32_t>::max(), std::numeric_limits<int32_t>::max()};
  Vertex high = {std::numeric_limits<int32_t>::min(), std::numeric_limits<int32_t>::min()};
  for (const Vertex& vertex : vertices) {
    if (!(vertex.inverse_depth > 0)) continue;
    low = {std::min(low.u, vertex.u), std::min(low.v, vertex.v)};
    high = {std::max(high.u, vertex.u), std::max(high.v, vertex.v)};
  }
  return high.u >= 0 && high.v >= 0 && low.u <= (lattice.columns - 1) * kSubSteps &&
         low.v <= (lattice.rows - 1) * kSubSteps;
}

// Lattice lines that a range of coordinates contains.
int FirstLine(int32_t coordinate) { return static_cast<int>((int64_t{coordinate} + kSubSteps - 1) >> kSubStepBits); }
int LastLine(int32_t coordinate) { return static_cast<int>(int64_t{coordinate} >> kSubStepBits); }

// Twice the signed area of (a, b, p); positive when they turn clockwise on a screen whose y points down.
int64_t EdgeFunction(const Vertex& a, const Vertex& b, int64_t u, int64_t v) {
  return (int64_t{b.u} - a.u) * (v - a.v) - (int64_t{b.v} - a.v) * (u - a.u);
}

void DrawTriangle(const Vertex& a, const Vertex& b, const Vertex& c, const Lattice& lattice, std::vector<Key>& keys) {
  const int first_column = std::max(FirstLine(std::min({a.u, b.u, c.u})), 0);
  const int last_column = std::min(LastLine(std::max({a.u, b.u, c.u})), lattice.columns - 1);
  const int first_row = std::max(FirstLine(std::min({a.v, b.v, c.v})), 0);
  const int last_row = std::min(LastLine(std::max({a.v, b.v, c.v})), lattice.rows - 1);
  if (first_column > last_column || first_row > last_row) return;
  // Corners are counter-clockwise as seen from the front.
  const int64_t area = -EdgeFunction(a, b, c.u, c.v);
  if (area <= 0) return;
  for (int row = first_row; row <= last_row; ++row) {
    const int64_t v = row * kSubSteps;
    for (int column = first_column; column <= last_column; ++column) {
      const int64_t u = column * kSubSteps;
      const int64_t ea = -EdgeFunction(b, c, u, v);
      const int64_t eb = -EdgeFunction(c, a, u, v);
      const int64_t ec = -EdgeFunction(a, b, u, v);
      if (ea < 0 || eb < 0 || ec < 0) continue;
      // Inverse depth, and what is divided by depth, are affine in the pixel.
      const double wa = static_cast<double>(ea) * a.inverse_depth;
      const double wb = static_cast<double>(eb) * b.inverse_depth;
      const double wc = static_cast<double>(ec) * c.inverse_depth;
      const double sum = wa + wb + wc;
      const auto depth = static_cast<float>(static_cast<double>(area) / sum);
      const auto quality = static_cast<float>((wa * a.quality + wb * b.quality + wc * c.quality) / sum);
      KeepLess(keys[static_cast<size_t>(lattice.Index(column, row))], MakeKey(depth, quality));
    }
  }
}

}  // namespace

AcceptedDepth AcceptedDepth::Empty(const Camera& reference, int step) {
  AcceptedDepth empty;
  empty.lattice = Lattice::For(reference, step);
  empty.depth.assign(static_cast<size_t>(empty.lattice.nodes()), 0.0F);
  empty.quality.assign(static_cast<size_t>(empty.lattice.nodes()), 0.0F);
  return empty;
}

AcceptedDepthBuffer::AcceptedDepthBuffer(const Camera& reference, int step)
    : reference_(reference),
      lattice_(Lattice::For(reference, step)),
      keys_(static_cast<size_t>(lattice_.nodes()), kNothing) {}

void AcceptedDepthBuffer::Add(const SparseSurface& accepted, ThreadPool& pool) {
  const std::vector<Vertex> vertices = ProjectPatches(accepted, reference_, lattice_, pool);
  if (!MayShow(vertices, lattice_)) return;
  const std::vector<std::array<int32_t, 3>> triangles = Triangulate(accepted);
  pool.ParallelFor(static_cast<int64_t>(triangles.size()), 2 * kPatchesAtOnce, [&](int64_t begin, int64_t end) {
    for (int64_t i = begin; i < end; ++i) {
      const auto& corners = triangles[static_cast<size_t>(i)];
      const Vertex& a = vertices[static_cast<size_t>(corners[0])];
      const Vertex& b = vertices[static_cast<size_t>(corners[1])];
      const Vertex& c = vertices[static_cast<size_t>(corners[2])];
      if (a.inverse_depth > 0 && b.inverse_depth > 0 && c.inverse_depth > 0) {
        DrawTriangle(a, b, c, lattice_, keys_);
      }
    }
  });
}

AcceptedDepth AcceptedDepthBuffer::Depth() const {
  AcceptedDepth visible = AcceptedDepth::Empty(reference_, lattice_.step);
  for (size_t i = 0; i < keys_.size(); ++i) {
    if (keys_[i] == kNothing) continue;
    visible.depth[i] = DepthOf(keys_[i]);
    visible.quality[i] = QualityOf(keys_[i]);
  }
  return visible;
}

}  // namespace meshwright
